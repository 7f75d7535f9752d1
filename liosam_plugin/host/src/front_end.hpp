// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/preprocess/voxel_grid.hpp"
#include "d2lio/types.hpp"
#include "features.hpp"
#include "projection.hpp"

namespace d2lio::liosam {

/// What scan matching gets of a scan: points in the IMU frame at the scan's end, m.
struct MatchCloud {
    std::vector<Eigen::Vector3f> corners, surfaces;
};

/// LIO-SAM's front end: range image, curvature features, down-sampling.
class FeatureFrontEnd {
  public:
    FeatureFrontEnd(const ProjectionOptions& projection, const FeatureOptions& features,
                    float corner_leaf, float surface_leaf);

    /// @param raw as measured; @param deskewed the same points at the scan's end, LiDAR frame.
    void run(const std::vector<LidarPoint>& raw, const std::vector<LidarPoint>& deskewed,
             const Pose& T_imu_lidar, MatchCloud& out);

  private:
    Projection projection_;
    FeatureExtractor extractor_;
    VoxelGrid corner_grid_, surface_grid_;
    OrderedScan ordered_;
    Features features_;
};

/// The direct front end: one centroid per voxel, all of them surfaces.
class DirectFrontEnd {
  public:
    explicit DirectFrontEnd(float leaf) : grid_(leaf) {}
    void run(const std::vector<LidarPoint>& deskewed, const Pose& T_imu_lidar, MatchCloud& out);

  private:
    VoxelGrid grid_;
    std::vector<Eigen::Vector3f> cloud_;
};

}  // namespace d2lio::liosam
