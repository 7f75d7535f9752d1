// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "local_map.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio::fastlio {
namespace {

constexpr double kMoveThreshold = 1.5;  ///< box faces keep this many detection ranges away

IkdTreeOptions tree_options(const HostConfig& config) {
    IkdTreeOptions o;
    o.downsample_leaf = static_cast<float>(config.filter_size_map);
    o.background_rebuild = config.background_rebuild;
    return o;
}

Eigen::Vector3f voxel_centre(const Eigen::Vector3f& p, float side) {
    return ((p / side).array().floor() + 0.5F).matrix() * side;
}

enum class Insertion { kByVoxel, kApart, kNone };

/// Whether the voxel of a point has one that bars it.
bool taken(const Eigen::Vector3f& p, const Eigen::Vector3f& centre, const Nearest& near, float side,
           LocalMap::Fill fill) {
    const float own = (p - centre).squaredNorm();
    for (int i = 0; i < near.count; ++i) {
        const Eigen::Vector3f off = near[i].point() - centre;
        const bool bars = fill == LocalMap::Fill::kEmpty
                              ? (off.cwiseAbs().array() <= 0.5F * side).all()
                              : off.squaredNorm() < own;
        if (bars) return true;
    }
    return false;
}

Insertion decide(const Eigen::Vector3f& p, const Nearest& near, float side, LocalMap::Fill fill) {
    if (near.count == 0) return Insertion::kByVoxel;
    const Eigen::Vector3f centre = voxel_centre(p, side);
    const Eigen::Array3f off = (near[0].point() - centre).cwiseAbs().array();
    if ((off > 0.5F * side).all()) return Insertion::kApart;
    return taken(p, centre, near, side, fill) ? Insertion::kNone : Insertion::kByVoxel;
}

}  // namespace

LocalMap::LocalMap(const HostConfig& config)
    : tree_(tree_options(config)),
      voxel_(static_cast<float>(config.filter_size_map)),
      half_side_(static_cast<float>(0.5 * config.box_side())),
      trigger_(static_cast<float>(kMoveThreshold * config.det_range)),
      shift_(static_cast<float>(
          std::max(0.45 * (config.box_side() - 2.0 * kMoveThreshold * config.det_range),
                   (kMoveThreshold - 1.0) * config.det_range))) {}

void LocalMap::clear() {
    tree_.clear();
    has_box_ = false;
}

void LocalMap::follow(const Vec3& lidar) {
    const Eigen::Vector3f c = lidar.cast<float>();
    if (!c.allFinite()) return;
    if (!has_box_) {
        box_ = {c - Eigen::Vector3f::Constant(half_side_),
                c + Eigen::Vector3f::Constant(half_side_)};
        has_box_ = true;
        return;
    }
    const Box old = box_;
    leaving_.clear();
    for (int a = 0; a < 3; ++a) {
        Box slab = old;
        if (std::abs(c[a] - old.min[a]) <= trigger_) {
            box_.min[a] -= shift_;
            box_.max[a] -= shift_;
            slab.min[a] = old.max[a] - shift_;
        } else if (std::abs(c[a] - old.max[a]) <= trigger_) {
            box_.min[a] += shift_;
            box_.max[a] += shift_;
            slab.max[a] = old.min[a] + shift_;
        } else {
            continue;
        }
        leaving_.push_back(slab);
    }
    if (!leaving_.empty()) tree_.erase_boxes(leaving_);
}

std::size_t LocalMap::insert(const std::vector<Eigen::Vector3f>& points,
                             const std::vector<Nearest>& neighbours, Fill fill) {
    if (neighbours.empty()) {
        tree_.insert(points, true);
        return points.size();
    }
    by_voxel_.clear();
    apart_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
        switch (decide(points[i], neighbours[i], voxel_, fill)) {
            case Insertion::kByVoxel:
                by_voxel_.push_back(points[i]);
                break;
            case Insertion::kApart:
                apart_.push_back(points[i]);
                break;
            case Insertion::kNone:
                break;
        }
    }
    tree_.insert(by_voxel_, true);
    tree_.insert(apart_, false);
    return by_voxel_.size() + apart_.size();
}

}  // namespace d2lio::fastlio
