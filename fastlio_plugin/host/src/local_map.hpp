// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/fastlio/config.hpp"
#include "d2lio/map/ikd_tree.hpp"

namespace d2lio::fastlio {

/// The ikd-tree with FAST-LIO2's sliding box and insertion rule.
class LocalMap {
  public:
    explicit LocalMap(const HostConfig& config);

    bool empty() const { return tree_.empty(); }
    const IkdTree& tree() const { return tree_; }
    void build(const std::vector<Eigen::Vector3f>& points) { tree_.build(points); }
    void clear();
    /// Moves the box when the LiDAR (map frame, m) comes near a face, and deletes what leaves it.
    void follow(const Vec3& lidar);
    /// Inserts a scan (map frame). A point is left out when the map has a point nearer to the
    /// centre of its voxel among the neighbours found for it; `neighbours` may be empty (all go
    /// in).
    void insert(const std::vector<Eigen::Vector3f>& points,
                const std::vector<Neighbours>& neighbours);

  private:
    IkdTree tree_;
    float voxel_, half_side_, trigger_, shift_;
    bool has_box_ = false;
    Box box_;
    std::vector<Eigen::Vector3f> by_voxel_, apart_;
    std::vector<Box> leaving_;
};

}  // namespace d2lio::fastlio
