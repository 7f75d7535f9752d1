// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "line_fit.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace d2lio::liosam {
namespace {

constexpr double kSpreadRatio = 3.0;
constexpr float kOnLine = 1e-6F;  ///< m

}  // namespace

Eigen::Vector3f Line::away_from(const Eigen::Vector3f& q) const {
    const Eigen::Vector3f d = q - point;
    const Eigen::Vector3f across = d - direction.dot(d) * direction;
    const float length = across.norm();
    return length > kOnLine ? Eigen::Vector3f(across / length) : direction.unitOrthogonal();
}

bool fit_line(const float* xyz, int stride, int count, Line& line) {
    if (count < 2) return false;
    const auto point = [&](int i) -> Eigen::Vector3d {
        return Eigen::Map<const Eigen::Vector3f>(xyz + i * stride).cast<double>();
    };
    Eigen::Vector3d c = Eigen::Vector3d::Zero();
    for (int i = 0; i < count; ++i) c += point(i);
    c /= count;
    Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
    for (int i = 0; i < count; ++i) {
        const Eigen::Vector3d d = point(i) - c;
        S += d * d.transpose();
    }
    if (!S.allFinite()) return false;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(S);
    const Eigen::Vector3d& lambda = solver.eigenvalues();
    if (!(lambda[2] > kSpreadRatio * lambda[1]) || !(lambda[2] > 0.0)) return false;
    line.point = c.cast<float>();
    line.direction = solver.eigenvectors().col(2).cast<float>().normalized();
    return true;
}

}  // namespace d2lio::liosam
