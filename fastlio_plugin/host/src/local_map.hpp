// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/fastlio/config.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "nearest.hpp"

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
    enum class Fill {
        kNearestToCentre,  ///< FAST-LIO2: of a voxel's points the one nearest to its centre stays
        /// What a voxel has stays: where the scan is blind along an axis, points that replace
        /// others would take the map along with the estimate.
        kEmpty,
    };
    /// Inserts a scan (map frame), judging a point by the neighbours found for it; `neighbours` may
    /// be empty (all go in).
    /// @returns how many points were found to belong in
    std::size_t insert(const std::vector<Eigen::Vector3f>& points,
                       const std::vector<Nearest>& neighbours, Fill fill = Fill::kNearestToCentre);

  private:
    IkdTree tree_;
    float voxel_, half_side_, trigger_, shift_;
    bool has_box_ = false;
    Box box_;
    std::vector<Eigen::Vector3f> by_voxel_, apart_;
    std::vector<Box> leaving_;
};

}  // namespace d2lio::fastlio
