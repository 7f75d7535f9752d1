// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

/// A map of points in cells of the search's radius. C++11.
namespace standin {

template <class Point>
class GridMap {
  public:
    /// @param leaf, radius m.
    GridMap(float leaf, float radius) : leaf_(leaf), radius_(radius) {}

    /// Keeps the first point of each voxel.
    void add(const Point& p) {
        if (taken_.emplace(cell(p, leaf_), true).second) cells_[cell(p, radius_)].push_back(p);
    }
    /// The k nearest points within the radius, ascending by squared distance.
    void search(const Point& p, std::size_t k, std::vector<Point>& found,
                std::vector<float>& sq) const {
        found.clear();
        sq.clear();
        const Key centre = cell(p, radius_);
        for (int i = 0; i < 27; ++i) {
            const Key key{
                {centre[0] + i % 3 - 1, centre[1] + i / 3 % 3 - 1, centre[2] + i / 9 - 1}};
            const auto at = cells_.find(key);
            if (at == cells_.end()) continue;
            for (const Point& q : at->second) insert(p, q, k, found, sq);
        }
    }

  private:
    using Key = std::array<int, 3>;
    static Key cell(const Point& p, float side) {
        return {{static_cast<int>(std::floor(p.x / side)), static_cast<int>(std::floor(p.y / side)),
                 static_cast<int>(std::floor(p.z / side))}};
    }
    void insert(const Point& p, const Point& q, std::size_t k, std::vector<Point>& found,
                std::vector<float>& sq) const {
        const float dx = q.x - p.x, dy = q.y - p.y, dz = q.z - p.z;
        const float d = dx * dx + dy * dy + dz * dz;
        const float limit = sq.size() == k ? sq.back() : radius_ * radius_;
        if (!(d < limit)) return;
        const auto at = std::upper_bound(sq.begin(), sq.end(), d) - sq.begin();
        sq.insert(sq.begin() + at, d);
        found.insert(found.begin() + at, q);
        if (sq.size() <= k) return;
        sq.pop_back();
        found.pop_back();
    }

    float leaf_, radius_;
    std::map<Key, bool> taken_;
    std::map<Key, std::vector<Point>> cells_;
};

}  // namespace standin
