// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/patch.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

using Eigen::Matrix2f;
using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr int kMaxPoints = 5;
constexpr float kPointSigma = 0.02F;  ///< m, at least, of a map point along the normal
constexpr float kUnknownBend = 0.5F;  ///< 1/m, of a surface nothing is known about
constexpr float kMaxSigma = 1.F;      ///< rad, of the normal along either axis
constexpr float kMinScatter = 1e-6F;  ///< m^2
constexpr float kMinFreedom = 1e-3F;  ///< 1 - leverage of a point

/// The points in the plane's own axes.
struct InPlane {
    int count;
    Vector3f e1, e2, centroid;
    Vector2f y[kMaxPoints];    ///< m, from the centroid
    float height[kMaxPoints];  ///< m, from the centroid, towards the sensor
    Matrix2f inverse;          ///< of the scatter of y, m^-2
    float extent;              ///< m^2, mean squared distance from the centroid
    float residual;            ///< m^2, variance of the heights
};

InPlane project(const float* xyz, int stride, int count, const Vector3f& normal,
                const Vector3f& towards) {
    InPlane f;
    f.count = std::min(count, kMaxPoints);
    f.e1 = normal.unitOrthogonal();
    f.e2 = normal.cross(f.e1);
    f.centroid.setZero();
    const auto point = [&](int i) { return Eigen::Map<const Vector3f>(xyz + i * stride); };
    for (int i = 0; i < f.count; ++i) f.centroid += point(i);
    f.centroid /= static_cast<float>(f.count);
    float a = kMinScatter, b = 0.F, d = kMinScatter, h = 0.F;
    for (int i = 0; i < f.count; ++i) {
        const Vector3f q = point(i) - f.centroid;
        f.y[i] = {f.e1.dot(q), f.e2.dot(q)};
        f.height[i] = towards.dot(q);
        a += f.y[i].x() * f.y[i].x();
        b += f.y[i].x() * f.y[i].y();
        d += f.y[i].y() * f.y[i].y();
        h += f.height[i] * f.height[i];
    }
    const float det = std::max(a * d - b * b, kMinScatter * (a + d + kMinScatter));
    f.inverse << d / det, -b / det, -b / det, a / det;
    f.extent = (a + d) / static_cast<float>(f.count);
    f.residual = h / static_cast<float>(std::max(f.count - 3, 1));
    return f;
}

/// Square root of the largest of what leaving out one point adds to S^-1.
Vector2f worst_loss(const InPlane& f) {
    const float n = static_cast<float>(f.count) / static_cast<float>(f.count - 1);
    Vector2f worst = Vector2f::Zero();
    float most = 0.F;
    for (int i = 0; i < f.count; ++i) {
        const Vector2f g = f.inverse * f.y[i];
        const float factor = n / std::max(kMinFreedom, 1.F - n * f.y[i].dot(g));
        const float size = factor * g.squaredNorm();
        if (!(size > most)) continue;
        most = size;
        worst = std::sqrt(factor) * g;
    }
    return worst;
}

void find_uncertainty(const InPlane& f, Patch& patch) {
    const float bend = 0.5F * kUnknownBend * f.extent;
    const float variance = std::max(kPointSigma * kPointSigma, f.residual) + bend * bend;
    const Matrix2f C = variance * f.inverse;
    const float l11 = std::sqrt(std::max(C(0, 0), 0.F));
    const float l21 = l11 > 0.F ? C(0, 1) / l11 : 0.F;
    const float l22 = std::sqrt(std::max(C(1, 1) - l21 * l21, 0.F));
    const auto capped = [](const Vector3f& s) -> Vector3f {
        const float length = s.norm();
        return length > kMaxSigma ? Vector3f(s * (kMaxSigma / length)) : s;
    };
    patch.s1 = capped(l11 * f.e1 + l21 * f.e2);
    patch.s2 = capped(l22 * f.e2);
    const Vector2f loss = std::sqrt(variance) * worst_loss(f);
    patch.doubt = capped(loss.x() * f.e1 + loss.y() * f.e2);
}

/// Both the heights and the half squared distances lose their own plane; what is left of them is
/// compared.
void find_bend(const InPlane& f, Patch& patch) {
    float half[kMaxPoints], mean = 0.F, height = 0.F;
    for (int i = 0; i < f.count; ++i) {
        half[i] = 0.5F * f.y[i].squaredNorm();
        mean += half[i];
        height += f.height[i];
    }
    mean /= static_cast<float>(f.count);
    height /= static_cast<float>(f.count);
    Vector2f slope = Vector2f::Zero(), tilt = Vector2f::Zero();
    for (int i = 0; i < f.count; ++i) {
        slope += (half[i] - mean) * f.y[i];
        tilt += f.height[i] * f.y[i];
    }
    slope = f.inverse * slope;
    tilt = f.inverse * tilt;
    for (int i = 0; i < f.count; ++i) {
        const float run = half[i] - mean - slope.dot(f.y[i]);
        patch.bend_rise += run * (f.height[i] - height - tilt.dot(f.y[i]));
        patch.bend_run += run * run;
    }
    patch.sag_mean = mean;
    patch.sag_slope = slope.x() * f.e1 + slope.y() * f.e2;
}

int facing_of(const Vector3f& n) {
    const auto quarter = [](float v) { return v >= 0.5F ? 3 : v >= 0.F ? 2 : v >= -0.5F ? 1 : 0; };
    return (quarter(n.x()) * 4 + quarter(n.y())) * 4 + quarter(n.z());
}

}  // namespace

double Patch::variance_along(const Eigen::Vector3d& d, double a) const {
    const double u1 = s1.cast<double>().dot(d), u2 = s2.cast<double>().dot(d);
    const double u3 = doubt.cast<double>().dot(d);
    const float total = s1.squaredNorm() + s2.squaredNorm() + doubt.squaredNorm();
    return u1 * u1 + u2 * u2 + u3 * u3 + 0.5 * static_cast<double>(total * total) * a * a;
}

float Patch::sag(const Vector3f& normal, const Vector3f& p) const {
    const Vector3f d = p - centroid;
    const float off = normal.dot(d);
    return 0.5F * (d.squaredNorm() - off * off) - sag_mean - sag_slope.dot(d);
}

Patch make_patch(const float* xyz, int stride, int count, const Vector3f& normal,
                 const Vector3f& sensor) {
    Patch patch;
    if (count < 4) {  // three points have no fit to judge
        patch.s1 = kMaxSigma * normal.unitOrthogonal();
        patch.s2 = kMaxSigma * normal.cross(normal.unitOrthogonal());
        return patch;
    }
    const bool away = normal.dot(sensor - Eigen::Map<const Vector3f>(xyz)) < 0.F;
    const Vector3f towards = away ? Vector3f(-normal) : normal;
    const InPlane f = project(xyz, stride, count, normal, towards);
    patch.centroid = f.centroid;
    patch.side = away ? -1.F : 1.F;
    patch.facing = facing_of(towards);
    find_uncertainty(f, patch);
    find_bend(f, patch);
    return patch;
}

}  // namespace d2lio
