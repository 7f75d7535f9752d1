// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "d2lio/map/box.hpp"
#include "d2lio/map/ikd_tree.hpp"

namespace d2lio::test {

using Points = std::vector<Eigen::Vector3f>;

inline bool lexicographic(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
}

inline Points sorted(Points points) {
    std::sort(points.begin(), points.end(), lexicographic);
    return points;
}

/// What the tree must do, by looking at every point.
class ReferenceMap {
  public:
    explicit ReferenceMap(float leaf) : leaf_(leaf) {}

    void build(const Points& points) { points_ = points; }
    void insert(const Eigen::Vector3f& p) { points_.push_back(p); }

    /// The nearest to the voxel's centre stays, ties by coordinates.
    void insert_downsampled(const Eigen::Vector3f& p) {
        const auto voxel = voxel_index(p);
        Points same{p};
        for (const Eigen::Vector3f& q : points_) {
            if (voxel_index(q) == voxel) same.push_back(q);
        }
        const Eigen::Vector3d centre =
            (Eigen::Vector3d(voxel[0], voxel[1], voxel[2]).array() + 0.5) *
            static_cast<double>(leaf_);
        const auto key = [&centre](const Eigen::Vector3f& q) {
            return std::make_tuple((q.cast<double>() - centre).squaredNorm(), q.x(), q.y(), q.z());
        };
        const Eigen::Vector3f best =
            *std::min_element(same.begin(), same.end(),
                              [&key](const auto& a, const auto& b) { return key(a) < key(b); });
        erase_if([&](const Eigen::Vector3f& q) { return voxel_index(q) == voxel; });
        points_.push_back(best);
    }

    std::size_t erase_box(const Box& box) {
        return erase_if([&box](const Eigen::Vector3f& q) {
            return q.x() >= box.min.x() && q.x() < box.max.x() && q.y() >= box.min.y() &&
                   q.y() < box.max.y() && q.z() >= box.min.z() && q.z() < box.max.z();
        });
    }
    std::size_t erase(const Eigen::Vector3f& p) {
        return erase_if([&p](const Eigen::Vector3f& q) { return q == p; });
    }

    std::vector<Neighbour> nearest(const Eigen::Vector3f& query, int k, float max_sq_dist) const {
        std::vector<Neighbour> found;
        for (const Eigen::Vector3f& p : points_) {
            const Eigen::Vector3f d = p - query;
            const float sq = (d.x() * d.x() + d.y() * d.y()) + d.z() * d.z();
            if (sq <= max_sq_dist) found.push_back({p.x(), p.y(), p.z(), sq});
        }
        const auto end =
            found.begin() + std::min<std::ptrdiff_t>(k, static_cast<std::ptrdiff_t>(found.size()));
        std::partial_sort(found.begin(), end, found.end(), nearer);
        found.erase(end, found.end());
        return found;
    }

    const Points& points() const { return points_; }

  private:
    static bool nearer(const Neighbour& a, const Neighbour& b) {
        return std::tie(a.sq_dist, a.x, a.y, a.z) < std::tie(b.sq_dist, b.x, b.y, b.z);
    }

    /// i with float(i * leaf) <= x < float((i + 1) * leaf), by walking to it.
    std::array<double, 3> voxel_index(const Eigen::Vector3f& p) const {
        std::array<double, 3> index{};
        const double leaf = static_cast<double>(leaf_);
        for (unsigned a = 0; a < 3; ++a) {
            const float x = p[static_cast<Eigen::Index>(a)];
            double i = std::round(static_cast<double>(x) / leaf) + 1.0;
            while (static_cast<float>(i * leaf) > x) i -= 1.0;
            index[a] = i;
        }
        return index;
    }

    template <typename Predicate>
    std::size_t erase_if(const Predicate& predicate) {
        const std::size_t before = points_.size();
        points_.erase(std::remove_if(points_.begin(), points_.end(), predicate), points_.end());
        return before - points_.size();
    }

    float leaf_;
    Points points_;
};

}  // namespace d2lio::test
