// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/rest_place.hpp"

#include <cmath>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"

namespace d2lio {
namespace {

constexpr double kSeenShare = 0.3;  ///< of noise: directions that tell motion from rest
constexpr double kDistance = 0.05;  ///< m
constexpr double kAngle = 0.01;     ///< rad
constexpr int kMostScans = 50;

}  // namespace

bool RestPlace::left(const Pose& estimate, const ScanDiagnostics& scan) const {
    const Vec3 moved = estimate.t - pose.t;
    for (int i = 0; i < 3; ++i) {
        const bool sees = scan.noise_share[i] < kSeenShare;
        if (sees && std::abs(scan.noise_axes.col(i).dot(moved)) > kDistance) return true;
    }
    return log_so3(pose.R.transpose() * estimate.R).norm() > kAngle;
}

void RestCloud::start(const std::vector<Eigen::Vector3f>& points) {
    points_ = points;
    scans_ = 1;
}

bool RestCloud::add(const std::vector<Eigen::Vector3f>& points) {
    if (scans_ >= kMostScans) return false;
    ++scans_;
    points_.insert(points_.end(), points.begin(), points.end());
    return true;
}

std::vector<Eigen::Vector3f> RestCloud::mean(double leaf) const {
    std::vector<Eigen::Vector3f> out;
    voxel_grid(points_, static_cast<float>(leaf), out);
    return out;
}

void RestCloud::finish() {
    points_ = {};
    scans_ = kMostScans;
}

}  // namespace d2lio
