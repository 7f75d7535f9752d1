// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

/// The sphere S^2 of fixed radius, charted around +x, for the gravity direction.
/// He, Xu, Zhang, "Kalman filters on differentiable manifolds", 2021, section on S^2(r).
namespace d2lio {

using Vec2 = Eigen::Vector2d;
using Mat32 = Eigen::Matrix<double, 3, 2>;
using Mat23 = Eigen::Matrix<double, 2, 3>;
using Mat2 = Eigen::Matrix2d;

/// Orthonormal basis (columns) of the plane tangent to the sphere at `g` (any length > 0): the
/// y and z axes turned by the shortest rotation that takes +x to g. Total at g = -x as well.
Mat32 sphere_basis(const Vec3& g);

/// g [+] u = Exp(B(g) u) g: turns g by |u| rad, length kept.
Vec3 sphere_plus(const Vec3& g, const Vec2& u);

/// a [-] b: the u with b [+] u = a (directions compared, lengths equal). pi away: (pi, 0).
Vec2 sphere_minus(const Vec3& a, const Vec3& b);

/// d(g [+] u)/du, 3x2. At u = 0: -hat(g) B(g).
/// `exact = false` leaves the leading rotation Exp(B u) out, as FAST-LIO2's filter does.
Mat32 sphere_plus_jacobian(const Vec3& g, const Vec2& u, bool exact = true);

/// d(y [-] x)/dy at y = x: N(x) = B(x)^T hat(x) / |x|^2, 2x3.
Mat23 sphere_minus_jacobian(const Vec3& x);

}  // namespace d2lio
