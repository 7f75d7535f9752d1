// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/types.hpp"

/// Covariances around a scan-to-map estimate. Order: rotation (right tangent, body axes), position
/// (map axes), unless said otherwise.
namespace d2lio::liosam {

/// Sigmas of a matched pose in the inertial graph, rad and m.
struct CorrectionNoise {
    double rotation, translation;
    double degenerate_rotation, degenerate_translation;
};

/// LIO-SAM's: one sigma for all directions, the larger one in a degenerate scan.
Mat6 upstream_correction(const CorrectionNoise& noise, bool degenerate);
/// The larger sigma along the weak directions only.
Mat6 weak_correction(const CorrectionNoise& noise, const ScanDiagnostics& scan);
/// A pose that is only predicted: carries no information worth the name.
Mat6 lost_covariance(const CorrectionNoise& noise);

/// Covariance of an estimate from the prediction's P and the scan's own information A^T A; the
/// directional prior is left out, so that P is not claimed twice.
Mat6 pose_covariance(const Mat6& P, const Mat6& AtA, double variance);
/// Of the first pose, which defines the map.
Mat6 start_covariance();
/// The same covariance with the position in axes turned by R.
Mat6 turn_position(const Mat3& R, const Mat6& covariance);
/// Position, then rotation about the map's axes.
Mat6 ros_order(const Pose& T_map_imu, const Mat6& covariance);

/// Turns roll and pitch of `R` (R_map_imu) by a share `weight` towards those of `world`
/// (R_world_imu of a 9-axis IMU). Yaw stays. Nothing changes near 90 deg of pitch.
Mat3 blend_tilt(const Mat3& R, const Mat3& world, double weight);

}  // namespace d2lio::liosam
