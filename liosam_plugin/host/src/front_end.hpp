// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
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

    /// Clouds without rings get them from the message order where lasers follow one another, as
    /// KITTI's. In any other order features would be nonsense: the scan is left without points.
    /// @returns why it was, else nothing.
    std::string find_rings(std::vector<LidarPoint>& points) const;
    /// @param raw as measured; @param deskewed the same points at the scan's end, LiDAR frame.
    void run(const std::vector<LidarPoint>& raw, const std::vector<LidarPoint>& deskewed,
             const Pose& T_imu_lidar, MatchCloud& out);

  private:
    int rings_;  ///< of the sensor
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
