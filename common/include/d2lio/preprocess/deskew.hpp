// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

/// Motion knot of a scan: the pose at one IMU sample and the motion over the interval ending there.
struct MotionKnot {
    double offset = 0.0;          ///< s after the scan's begin
    Mat3 rot = Mat3::Identity();  ///< R_map_imu
    Vec3 pos = Vec3::Zero();      ///< m, map
    Vec3 vel = Vec3::Zero();      ///< m/s, map
    Vec3 gyro = Vec3::Zero();     ///< of the interval ending here, bias removed, rad/s
    Vec3 accel = Vec3::Zero();    ///< of the interval ending here, gravity removed, map, m/s^2
};

/// Moves every point to the LiDAR frame at the scan end (backward propagation, FAST-LIO2, section
/// IV-B; paper eq. 2). A point of time t in (o_h, o_h+1] uses knot h's pose and the motion held
/// over that interval; points after the last knot extrapolate the last interval. Points at or
/// before the first knot stay as measured.
/// @param points in any order of time; their coordinates are replaced (LiDAR frame, m).
/// @param knots ascending by offset.
/// @param end T_map_imu at the scan end; @param extrinsic T_imu_lidar.
void deskew(std::vector<LidarPoint>& points, const std::vector<MotionKnot>& knots, const Pose& end,
            const Pose& extrinsic);

}  // namespace d2lio
