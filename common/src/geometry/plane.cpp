// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/geometry/plane.hpp"

#include <cmath>

namespace d2lio {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Vector3d point(const float* xyz, int stride, int i) {
    const float* p = xyz + static_cast<std::ptrdiff_t>(i) * stride;
    return {p[0], p[1], p[2]};
}

/// Adjugate of a symmetric 3x3 matrix: adj(S) = det(S) S^-1 where that exists.
Matrix3d symmetric_adjugate(const Matrix3d& s) {
    Matrix3d a;
    a(0, 0) = s(1, 1) * s(2, 2) - s(1, 2) * s(1, 2);
    a(1, 1) = s(0, 0) * s(2, 2) - s(0, 2) * s(0, 2);
    a(2, 2) = s(0, 0) * s(1, 1) - s(0, 1) * s(0, 1);
    a(0, 1) = a(1, 0) = s(0, 2) * s(1, 2) - s(0, 1) * s(2, 2);
    a(0, 2) = a(2, 0) = s(0, 1) * s(1, 2) - s(0, 2) * s(1, 1);
    a(1, 2) = a(2, 1) = s(0, 1) * s(0, 2) - s(0, 0) * s(1, 2);
    return a;
}

PlaneMoments moments_of(const Vector3d& c, const Matrix3d& S) {
    const auto entry = [&S](int i, int j) { return static_cast<float>(S(i, j)); };
    return {c.cast<float>(),
            {entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)}};
}

}  // namespace

PlaneStatus fit_plane(const float* xyz, int stride, int count, const PlaneFitOptions& options,
                      Plane& plane, PlaneMoments* moments) {
    if (count < 3) return PlaneStatus::kSingular;
    const double n = count;
    Vector3d c = Vector3d::Zero();
    for (int i = 0; i < count; ++i) c += point(xyz, stride, i);
    c /= n;
    Matrix3d scatter = Matrix3d::Zero();
    for (int i = 0; i < count; ++i) {
        const Vector3d d = point(xyz, stride, i) - c;
        scatter.noalias() += d * d.transpose();
    }
    if (moments != nullptr) *moments = moments_of(c, scatter);
    const Matrix3d adj = symmetric_adjugate(scatter);
    const double trace = scatter.trace();
    // trace(adj) is the sum of the products of eigenvalue pairs, close to largest x middle.
    if (!(adj.trace() > options.min_spread_ratio * trace * trace)) return PlaneStatus::kSingular;
    const Vector3d u = adj * c;
    const double length = u.norm();
    if (!(length > 0.0) || !std::isfinite(length)) return PlaneStatus::kSingular;

    const Vector3d normal = -u / length;
    const double det = scatter.row(0).dot(adj.col(0));
    plane.normal = normal.cast<float>();
    plane.d = static_cast<float>(-normal.dot(c) + det / (n * length));
    for (int i = 0; i < count; ++i) {
        const double r = normal.dot(point(xyz, stride, i) - c) + det / (n * length);
        if (!(std::abs(r) <= static_cast<double>(options.max_distance))) return PlaneStatus::kRough;
    }
    return PlaneStatus::kOk;
}

}  // namespace d2lio
