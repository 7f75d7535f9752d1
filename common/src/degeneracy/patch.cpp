// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/patch.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

using Eigen::Vector3f;

constexpr float kMinScatter = 1e-6F;  ///< m^2
constexpr float kPointSigma = 0.02F;  ///< m, at least, of a map point along the normal
constexpr float kUnknownBend = 0.5F;  ///< 1/m, of a surface nothing is known about
constexpr float kMostVariance = 1.F;  ///< rad^2, of the normal along any axis
constexpr float kMostDoubt = 1.F;     ///< rad
constexpr float kMinFreedom = 1e-3F;  ///< 1 - leverage of a point

/// N points in the plane's own axes, coordinate by coordinate.
template <int N>
struct InPlane {
    using Numbers = Eigen::Array<float, N, 1>;

    Vector3f e1, e2, centroid;
    Numbers u, v;    ///< m, from the centroid
    Numbers height;  ///< m, from the centroid, towards the sensor
    float variance;  ///< m^2, of a height about the surface's tangent plane
    float a, b, d;   ///< inverse of the scatter of (u, v), m^-2: (a, b; b, d)

    InPlane(const float* xyz, int stride, const Vector3f& normal, const Vector3f& towards);
};

template <int N>
InPlane<N>::InPlane(const float* xyz, int stride, const Vector3f& normal, const Vector3f& towards)
    : e1(normal.unitOrthogonal()), e2(normal.cross(e1)) {
    Numbers x, y, z;
    for (int i = 0; i < N; ++i) {
        const float* const p = xyz + i * stride;
        x[i] = p[0];
        y[i] = p[1];
        z[i] = p[2];
    }
    centroid = Vector3f(x.mean(), y.mean(), z.mean());
    x -= centroid.x();
    y -= centroid.y();
    z -= centroid.z();
    u = e1.x() * x + e1.y() * y + e1.z() * z;
    v = e2.x() * x + e2.y() * y + e2.z() * z;
    height = towards.x() * x + towards.y() * y + towards.z() * z;
    const float residual = height.square().sum() / std::max(N - 3, 1);
    const float uu = u.square().sum() + kMinScatter, vv = v.square().sum() + kMinScatter;
    const float uv = (u * v).sum();
    const float bend = 0.5F * kUnknownBend * (uu + vv) / N;
    variance = std::max(kPointSigma * kPointSigma, residual) + bend * bend;
    const float per_det = 1.F / std::max(uu * vv - uv * uv, kMinScatter * (uu + vv));
    a = vv * per_det;
    b = -uv * per_det;
    d = uu * per_det;
}

/// Symmetric 2x2: (a, b; b, d).
struct Sym2 {
    float a, b, d;
};

/// With no eigenvalue above kMostVariance.
Sym2 capped(const Sym2& C) {
    if (!(C.a + C.d > kMostVariance)) return C;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2f> eigen(
        (Eigen::Matrix2f() << C.a, C.b, C.b, C.d).finished());
    const Eigen::Matrix2f V = eigen.eigenvectors();
    const Eigen::Matrix2f out =
        V * eigen.eigenvalues().cwiseMin(kMostVariance).asDiagonal() * V.transpose();
    return {out(0, 0), out(0, 1), out(1, 1)};
}

/// Covariance of the normal, and the largest of what leaving out one point adds to it: with
/// S less one point (and its share of the centroid) by Sherman-Morrison.
template <int N>
void find_uncertainty(const InPlane<N>& f, Patch& patch) {
    const Sym2 C = capped({f.variance * f.a, f.variance * f.b, f.variance * f.d});
    const Vector3f p = C.a * f.e1 + C.b * f.e2, q = C.b * f.e1 + C.d * f.e2;
    const auto entry = [&](int i, int j) { return p[i] * f.e1[j] + q[i] * f.e2[j]; };
    patch.covariance = {entry(0, 0), entry(0, 1), entry(0, 2),
                        entry(1, 1), entry(1, 2), entry(2, 2)};

    using Numbers = typename InPlane<N>::Numbers;
    constexpr float kLess = 1.F - 1.F / N;
    const Numbers gu = f.a * f.u + f.b * f.v, gv = f.b * f.u + f.d * f.v;
    const Numbers freedom = (kLess - f.u * gu - f.v * gv).max(kMinFreedom);
    const Numbers loss = (gu.square() + gv.square()) / freedom;
    int worst = 0;
    for (int i = 1; i < N; ++i) {
        if (loss[i] > loss[worst]) worst = i;
    }
    if (!(loss[worst] > 0.F)) return;
    const float size = std::min(std::sqrt(f.variance / freedom[worst]),
                                kMostDoubt / std::sqrt(loss[worst] * freedom[worst]));
    patch.doubt = size * (gu[worst] * f.e1 + gv[worst] * f.e2);
}

/// Regression of the heights on the half squared distances, from which their own plane is taken.
/// (The rest of a regression is orthogonal to what was taken out, so the heights need not lose
/// theirs.)
template <int N>
void find_bend(const InPlane<N>& f, Patch& patch) {
    using Numbers = typename InPlane<N>::Numbers;
    const Numbers half = 0.5F * (f.u.square() + f.v.square());
    patch.sag_mean = half.mean();
    const Numbers off = half - patch.sag_mean;
    const float ou = (off * f.u).sum(), ov = (off * f.v).sum();
    const float su = f.a * ou + f.b * ov, sv = f.b * ou + f.d * ov;
    const Numbers run = off - su * f.u - sv * f.v;
    patch.bend_rise = (run * f.height).sum();
    patch.bend_run = run.square().sum();
    patch.sag_slope = su * f.e1 + sv * f.e2;
}

int facing_of(const Vector3f& n) {
    const auto quarter = [](float v) { return v >= 0.5F ? 3 : v >= 0.F ? 2 : v >= -0.5F ? 1 : 0; };
    return (quarter(n.x()) * 4 + quarter(n.y())) * 4 + quarter(n.z());
}

template <int N>
void describe(const float* xyz, int stride, const Vector3f& normal, const Vector3f& towards,
              Patch& patch) {
    const InPlane<N> f(xyz, stride, normal, towards);
    patch.centroid = f.centroid;
    find_uncertainty(f, patch);
    find_bend(f, patch);
}

}  // namespace

double Patch::variance_along(const Eigen::Vector3d& d, double a) const {
    const Vector3f w = d.cast<float>();
    const auto& [xx, xy, xz, yy, yz, zz] = covariance;
    const float formal = w.x() * (xx * w.x() + 2.F * (xy * w.y() + xz * w.z())) +
                         w.y() * (yy * w.y() + 2.F * yz * w.z()) + zz * w.z() * w.z();
    const float doubted = doubt.dot(w);
    const float total = xx + yy + zz + doubt.squaredNorm();
    const auto component = static_cast<float>(a);
    return static_cast<double>(formal + doubted * doubted +
                               0.5F * total * total * component * component);
}

float Patch::sag(const Vector3f& normal, const Vector3f& p) const {
    const Vector3f d = p - centroid;
    const float off = normal.dot(d);
    return 0.5F * (d.squaredNorm() - off * off) - sag_mean - sag_slope.dot(d);
}

Patch make_patch(const float* xyz, int stride, int count, const Vector3f& normal,
                 const Vector3f& sensor) {
    Patch patch;
    if (count < 4) {  // three points have no fit to judge: anything in the plane is possible
        for (int i = 0, k = 0; i < 3; ++i) {
            for (int j = i; j < 3; ++j, ++k) {
                const auto at = static_cast<std::size_t>(k);
                patch.covariance[at] = (i == j ? 1.F : 0.F) - normal[i] * normal[j];
            }
        }
        return patch;
    }
    const bool away = normal.dot(sensor - Eigen::Map<const Vector3f>(xyz)) < 0.F;
    const Vector3f towards = away ? Vector3f(-normal) : normal;
    patch.side = away ? -1.F : 1.F;
    patch.facing = facing_of(towards);
    if (count == 4) {
        describe<4>(xyz, stride, normal, towards, patch);
    } else {
        describe<5>(xyz, stride, normal, towards, patch);
    }
    return patch;
}

}  // namespace d2lio
