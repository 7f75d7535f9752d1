// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/geometry/state.hpp"

/// Discrete IMU forward propagation with covariance (D2-LIO paper, section III-C; FAST-LIO2, eq.
/// 3-5).
namespace d2lio {

using Mat23x12 = Eigen::Matrix<double, 23, 12>;
using Mat12 = Eigen::Matrix<double, 12, 12>;

/// Strengths of the process noise. They enter as dt^2 Q, as in FAST-LIO2: a covariance per step,
/// not a spectral density; a density n (SI per sqrt(Hz)) at rate f corresponds to n^2 f.
struct ProcessNoise {
    double gyro = 0.1;         ///< (rad/s)^2
    double accel = 0.1;        ///< (m/s^2)^2
    double gyro_bias = 1e-4;   ///< (rad/s^2)^2
    double accel_bias = 1e-4;  ///< (m/s^3)^2

    /// 12x12 diagonal, order n_g, n_a, n_bg, n_ba.
    Mat12 matrix() const;
};

/// One inertial input held constant over a step.
struct ImuInput {
    Vec3 gyro = Vec3::Zero();   ///< rad/s
    Vec3 accel = Vec3::Zero();  ///< m/s^2, specific force
};

/// x after dt seconds: Euler step on the manifold with everything evaluated at x,
/// p += v dt, R = R Exp((w - b_g) dt), v += (R (a - b_a) + g) dt.
NavState propagate_state(const NavState& x, const ImuInput& u, double dt);

/// d(propagated error)/d(error), 23x23. `exact`: with the rotation block Exp(-(w - b_g) dt);
/// otherwise that block is the identity, as FAST-LIO2's filter computes it.
Mat23x23 propagation_jacobian(const NavState& x, const ImuInput& u, double dt, bool exact);

/// d(propagated error)/d(noise), 23x12, without the factor dt.
Mat23x12 propagation_noise_jacobian(const NavState& x, const ImuInput& u, double dt);

/// One step of state and covariance, P = F P F^T + dt^2 W Q W^T. P comes out symmetric.
void propagate(NavState& x, Mat23x23& P, const ImuInput& u, double dt, const Mat12& Q, bool exact);

}  // namespace d2lio
