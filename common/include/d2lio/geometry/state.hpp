// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

namespace d2lio {

/// First index of each block in the 23-dimensional error state of FAST-LIO2.
struct StateIndex {
    static constexpr int kPos = 0, kRot = 3, kExtrinsicRot = 6, kExtrinsicPos = 9, kVel = 12,
                         kGyroBias = 15, kAccelBias = 18, kGravity = 21, kSize = 23;
};

using Vec23 = Eigen::Matrix<double, StateIndex::kSize, 1>;
using Mat23x23 = Eigen::Matrix<double, StateIndex::kSize, StateIndex::kSize>;

/// State on R^3 x SO(3) x SO(3) x R^3 x R^9 x S^2, 23 degrees of freedom (Xu et al., FAST-LIO2,
/// 2022, eq. 1). Rotations are perturbed on the right.
struct NavState {
    Vec3 pos = Vec3::Zero();                ///< IMU in map, m
    Mat3 rot = Mat3::Identity();            ///< R_map_imu
    Mat3 extrinsic_rot = Mat3::Identity();  ///< R_imu_lidar
    Vec3 extrinsic_pos = Vec3::Zero();      ///< t_imu_lidar, m
    Vec3 vel = Vec3::Zero();                ///< of the IMU in map, m/s
    Vec3 gyro_bias = Vec3::Zero();          ///< rad/s
    Vec3 accel_bias = Vec3::Zero();         ///< m/s^2
    Vec3 gravity = Vec3(0.0, 0.0, -9.809);  ///< in map, m/s^2; its length never changes

    Pose T_map_imu() const { return {rot, pos}; }
    Pose T_imu_lidar() const { return {extrinsic_rot, extrinsic_pos}; }
    Pose T_map_lidar() const { return T_map_imu() * T_imu_lidar(); }
    bool is_finite() const;
};

/// x [+] d, blocks as in StateIndex; rotations are renormalised.
NavState state_plus(const NavState& x, const Vec23& d);

/// a [-] b: the d with b [+] d = a.
Vec23 state_minus(const NavState& a, const NavState& b);

/// J = d((x [+] (d + e)) [-] (x [+] d))/de at e = 0, block diagonal: identity but for the rotation
/// blocks J_r(d) and the gravity block N(x [+] d) M(x, d). Carries a covariance in the tangent
/// space at x over to that at x [+] d (He et al. 2021, eq. for J_k). `exact = false`: see
/// sphere_plus_jacobian.
Mat23x23 state_transport(const NavState& x, const Vec23& d, bool exact = true);

}  // namespace d2lio
