// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/patch.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "in_plane.hpp"

namespace d2lio {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float kMostDoubt = 1.F;     ///< rad
constexpr float kMinFreedom = 1e-3F;  ///< 1 - leverage of a point

using Vector = in_plane::Vector<float>;
using Upper = in_plane::Upper<float>;

Vector vector(const Vector3f& v) { return {v.x(), v.y(), v.z()}; }
Vector3f vector(const Vector& v) { return {v.x, v.y, v.z}; }

}  // namespace

in_plane::Upper<float> in_plane::capped(const Upper<float>& C) {
    Matrix3f m;
    m << C[0], C[1], C[2], C[1], C[3], C[4], C[2], C[4], C[5];
    const Eigen::SelfAdjointEigenSolver<Matrix3f> eigen(m);
    const Matrix3f V = eigen.eigenvectors();
    Vector3f variances = eigen.eigenvalues().cwiseMin(kMostVariance);
    variances[0] = 0.F;
    m = V * variances.asDiagonal() * V.transpose();
    return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
}

/// With the inverse scatter less one point (and its share of the centroid) by Sherman-Morrison.
Vector3f Patch::find_doubt(const Vector3f& normal) const {
    Upper S{};
    const auto offset = [this](int i) {
        return Eigen::Map<const Vector3f>(offsets.data() + 3 * i);
    };
    for (int i = 0; i < kCount; ++i) {
        for (int j = 0, at = 0; j < 3; ++j) {
            for (int k = j; k < 3; ++k)
                S[static_cast<std::size_t>(at++)] += offset(i)[j] * offset(i)[k];
        }
    }
    const Vector n = vector(normal);
    const Upper inverse = in_plane::scatter_of(S, n, in_plane::multiply(S, n)).inverse;
    constexpr float kLess = 1.F - 1.F / kCount;
    float worst = 0.F, freedom = 1.F;
    Vector3f change = Vector3f::Zero();
    for (int i = 0; i < kCount; ++i) {
        const Vector3f g = vector(in_plane::multiply(inverse, vector(offset(i))));
        const float free = std::max(kLess - offset(i).dot(g), kMinFreedom);
        const float loss = g.squaredNorm() / free;
        if (!(loss > worst)) continue;
        worst = loss;
        freedom = free;
        change = g;
    }
    if (!(worst > 0.F)) return change;
    const float size =
        std::min(std::sqrt(variance / freedom), kMostDoubt / std::sqrt(worst * freedom));
    return size * change;
}

double Patch::variance_along(const Eigen::Vector3d& d, const Eigen::Vector3d& normal) const {
    const Vector3f& left_out = doubt(normal.cast<float>());
    const double doubted = left_out.cast<double>().dot(d);
    const double total =
        static_cast<double>(covariance[0] + covariance[3] + covariance[5] + left_out.squaredNorm());
    const double a = normal.dot(d);
    return static_cast<double>(formal_variance(d.cast<float>())) + doubted * doubted +
           0.5 * total * total * a * a;
}

void make_patch(const float* xyz, int stride, int count, const PlaneMoments& moments,
                const Vector3f& normal, const SurfaceSide& side, Patch& patch) {
    if (count < Patch::kCount) {  // no fit to judge: anything in the plane is possible
        patch = Patch();
        for (int i = 0, k = 0; i < 3; ++i) {
            for (int j = i; j < 3; ++j, ++k) {
                const auto at = static_cast<std::size_t>(k);
                patch.covariance[at] = (i == j ? 1.F : 0.F) - normal[i] * normal[j];
            }
        }
        return;
    }
    patch.forget_doubt();
    patch.side = side;
    patch.centroid = moments.centroid;
    std::array<Vector, Patch::kCount> offsets;
    for (int i = 0; i < Patch::kCount; ++i) {
        const float* const p = xyz + i * stride;
        float* const o = patch.offsets.data() + 3 * i;
        for (int k = 0; k < 3; ++k) o[k] = p[k] - moments.centroid[k];
        offsets[static_cast<std::size_t>(i)] = {o[0], o[1], o[2]};
    }
    const Vector n = vector(normal), Sn = in_plane::multiply(moments.scatter, n);
    const in_plane::Scatter<float> plane = in_plane::scatter_of(moments.scatter, n, Sn);
    patch.variance = in_plane::variance_of(plane);
    for (std::size_t i = 0; i < 6; ++i) patch.covariance[i] = patch.variance * plane.inverse[i];
    const Upper& C = patch.covariance;
    if (C[0] + C[3] + C[5] > in_plane::kMostVariance) patch.covariance = in_plane::capped(C);
    const in_plane::Bend<float> bend = in_plane::bend_of(offsets, plane.inverse, n, Sn);
    patch.bend_rise = side.sign * bend.rise;
    patch.bend_run = bend.run;
    patch.sag_mean = bend.mean;
    patch.sag_slope = vector(bend.slope);
}

}  // namespace d2lio
