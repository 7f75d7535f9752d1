// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace d2lio {

/// Time in integer nanoseconds since an arbitrary epoch common to LiDAR and IMU.
using Stamp = std::int64_t;

constexpr double kNanosecond = 1e-9;  ///< seconds per nanosecond

/// Difference `a - b` in seconds.
inline double seconds_between(Stamp a, Stamp b) { return static_cast<double>(a - b) * kNanosecond; }

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// Rigid transform T_a_b: maps a point in frame b to frame a, p_a = R p_b + t.
struct Pose {
    Mat3 R = Mat3::Identity();
    Vec3 t = Vec3::Zero();  ///< m

    Vec3 operator*(const Vec3& p) const { return R * p + t; }
    Pose operator*(const Pose& o) const { return {R * o.R, R * o.t + t}; }
    Pose inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
};

/// One inertial sample in the IMU frame.
struct ImuSample {
    Stamp stamp = 0;
    Vec3 gyro = Vec3::Zero();   ///< angular rate, rad/s
    Vec3 accel = Vec3::Zero();  ///< specific force, m/s^2 (+g upwards at rest)
    /// Of a 9-axis sensor: unit quaternion x y z w of R_world_imu, z up; zeros where there is none.
    Eigen::Vector4d orientation = Eigen::Vector4d::Zero();

    /// Whether there is one: NaN, zeros and what is far from unit length are none.
    bool has_orientation() const {
        const double length = orientation.norm();
        return length > 0.99 && length < 1.01;
    }
};

/// One LiDAR return in the LiDAR frame, at its own time `Scan::stamp + dt_ns`.
struct LidarPoint {
    float x = 0.F, y = 0.F, z = 0.F;  ///< m
    float intensity = 0.F;            ///< sensor units
    std::int32_t dt_ns = 0;           ///< offset from Scan::stamp, ns
    std::uint16_t ring = 0;           ///< beam index, 0 where the sensor has none

    Eigen::Vector3f xyz() const { return {x, y, z}; }
};

/// One sweep in message order.
struct Scan {
    Stamp stamp = 0;  ///< time to which `dt_ns` refers
    std::vector<LidarPoint> points;
};

}  // namespace d2lio
