// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/geometry/sphere.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {
namespace {

constexpr double kTolerance = 1e-11;
constexpr double kPi = 3.14159265358979323846;

}  // namespace

Mat32 sphere_basis(const Vec3& g) {
    const double length = g.norm();
    Mat32 basis = Mat32::Zero();
    if (g.x() + length <= kTolerance) {  // the chart's blind point, g = -x
        basis(1, 1) = -1.0;
        basis(2, 0) = 1.0;
        return basis;
    }
    // Rotation by the angle between +x and n, axis x * n, applied to the y and z axes.
    const Vec3 n = g / length;
    const double k = 1.0 / (1.0 + n.x());
    basis.col(0) = Vec3(-n.y(), 1.0 - k * n.y() * n.y(), -k * n.y() * n.z());
    basis.col(1) = Vec3(-n.z(), -k * n.y() * n.z(), 1.0 - k * n.z() * n.z());
    return basis;
}

Vec3 sphere_plus(const Vec3& g, const Vec2& u) { return exp_so3(sphere_basis(g) * u) * g; }

Vec2 sphere_minus(const Vec3& a, const Vec3& b) {
    const Vec3 axis = b.cross(a);
    const double sine = axis.norm();
    const double theta = std::atan2(sine, a.dot(b));
    if (sine < kTolerance) return theta > kTolerance ? Vec2(kPi, 0.0) : Vec2(0.0, 0.0);
    return theta / sine * (sphere_basis(b).transpose() * axis);
}

Mat32 sphere_plus_jacobian(const Vec3& g, const Vec2& u, bool exact) {
    const Mat32 B = sphere_basis(g);
    const Vec3 phi = B * u;
    const Mat32 J = -hat(g) * right_jacobian_so3(phi) * B;
    if (!exact) return J;
    return exp_so3(phi) * J;
}

Mat23 sphere_minus_jacobian(const Vec3& x) {
    return sphere_basis(x).transpose() * hat(x) / x.squaredNorm();
}

}  // namespace d2lio
