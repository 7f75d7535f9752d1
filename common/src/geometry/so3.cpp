// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/geometry/so3.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace d2lio {
namespace {

/// Below this angle the closed forms lose digits to cancellation; the series are exact to 1e-16.
constexpr double kSmallAngle = 1e-4;

}  // namespace

Mat3 hat(const Vec3& a) {
    Mat3 m;
    m << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
    return m;
}

Mat3 exp_so3(const Vec3& phi) {
    const double theta2 = phi.squaredNorm();
    const double theta = std::sqrt(theta2);
    const bool small = theta < kSmallAngle;
    const double a = small ? 1.0 - theta2 / 6.0 : std::sin(theta) / theta;
    const double half = std::sin(0.5 * theta);
    const double b = small ? 0.5 - theta2 / 24.0 : 2.0 * half * half / theta2;
    const Mat3 K = hat(phi);
    return Mat3::Identity() + a * K + b * K * K;
}

Vec3 log_so3(const Mat3& R) {
    const Eigen::Quaterniond q(R);
    const double sign = q.w() < 0.0 ? -1.0 : 1.0;
    const double n = q.vec().norm();
    const double w = std::abs(q.w());
    const double scale = n < 1e-9 ? 2.0 / w : 2.0 * std::atan2(n, w) / n;
    return sign * scale * q.vec();
}

Mat3 left_jacobian_so3(const Vec3& phi) {
    const double theta2 = phi.squaredNorm();
    const double theta = std::sqrt(theta2);
    const bool small = theta < kSmallAngle;
    const double half = std::sin(0.5 * theta);
    const double a = small ? 0.5 - theta2 / 24.0 : 2.0 * half * half / theta2;
    const double b =
        small ? 1.0 / 6.0 - theta2 / 120.0 : (theta - std::sin(theta)) / (theta2 * theta);
    const Mat3 K = hat(phi);
    return Mat3::Identity() + a * K + b * K * K;
}

Mat3 right_jacobian_inverse_so3(const Vec3& phi) {
    const double theta2 = phi.squaredNorm();
    const double theta = std::sqrt(theta2);
    const double half = 0.5 * theta;
    const double b =
        theta < kSmallAngle ? 1.0 / 12.0 + theta2 / 720.0 : (1.0 - half / std::tan(half)) / theta2;
    const Mat3 K = hat(phi);
    return Mat3::Identity() + 0.5 * K + b * K * K;
}

Mat3 renormalise_so3(const Mat3& M) {
    return Eigen::Quaterniond(M).normalized().toRotationMatrix();
}

}  // namespace d2lio
