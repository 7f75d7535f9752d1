// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

/// Rotation group SO(3) with right (body) perturbations, R [+] d = R Exp(d).
/// Formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", 2018.
namespace d2lio {

/// Cross-product matrix, hat(a) b = a x b.
Mat3 hat(const Vec3& a);

/// Rotation by the vector `phi` (rad). Exact at every angle, series near zero.
Mat3 exp_so3(const Vec3& phi);

/// Rotation vector of `R` in (-pi, pi], rad. Stable near 0 and near pi.
Vec3 log_so3(const Mat3& R);

/// Left Jacobian: Exp(phi + d) ~ Exp(J_l(phi) d) Exp(phi).
Mat3 left_jacobian_so3(const Vec3& phi);

/// Right Jacobian: Exp(phi + d) ~ Exp(phi) Exp(J_r(phi) d); J_r(phi) = J_l(phi)^T.
inline Mat3 right_jacobian_so3(const Vec3& phi) { return left_jacobian_so3(phi).transpose(); }

/// Inverse right Jacobian: Log(Exp(phi) Exp(d)) ~ phi + J_r^-1(phi) d. Needs |phi| < 2 pi.
Mat3 right_jacobian_inverse_so3(const Vec3& phi);

/// Rotation closest to `M` in the Frobenius norm (by quaternion normalisation; `M` must be near
/// SO(3) already).
Mat3 renormalise_so3(const Mat3& M);

}  // namespace d2lio
