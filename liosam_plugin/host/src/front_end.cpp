// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "front_end.hpp"

#include "projection_rings.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kLeastRings = 4;  ///< turns in a message that are taken for rings

void to_imu(const Pose& T_imu_lidar, std::vector<Eigen::Vector3f>& points) {
    for (Eigen::Vector3f& p : points) p = (T_imu_lidar * p.cast<double>()).cast<float>();
}

}  // namespace

FeatureFrontEnd::FeatureFrontEnd(const ProjectionOptions& projection,
                                 const FeatureOptions& features, float corner_leaf,
                                 float surface_leaf)
    : rings_(projection.rings),
      projection_(projection),
      extractor_(features),
      corner_grid_(corner_leaf),
      surface_grid_(surface_leaf) {}

std::string FeatureFrontEnd::find_rings(std::vector<LidarPoint>& points) const {
    if (points.empty() || has_rings(points)) return {};
    const int turns = assign_rings_by_turns(points);
    if (turns >= kLeastRings && turns <= rings_) return {};
    points.clear();
    return "no ring index, and " + std::to_string(turns) + " turns in the message for N_SCAN " +
           std::to_string(rings_) + ": features cannot be told; use front_end: direct";
}

void FeatureFrontEnd::run(const std::vector<LidarPoint>& raw,
                          const std::vector<LidarPoint>& deskewed, const Pose& T_imu_lidar,
                          MatchCloud& out) {
    projection_.project(raw, deskewed, ordered_);
    extractor_.extract(ordered_, features_);
    corner_grid_.filter(features_.corners, out.corners);
    surface_grid_.filter(features_.surfaces, out.surfaces);
    to_imu(T_imu_lidar, out.corners);
    to_imu(T_imu_lidar, out.surfaces);
}

void DirectFrontEnd::run(const std::vector<LidarPoint>& deskewed, const Pose& T_imu_lidar,
                         MatchCloud& out) {
    cloud_.clear();
    for (const LidarPoint& p : deskewed) cloud_.push_back(p.xyz());
    out.corners.clear();
    grid_.filter(cloud_, out.surfaces);
    to_imu(T_imu_lidar, out.surfaces);
}

}  // namespace d2lio::liosam
