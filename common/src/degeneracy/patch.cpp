// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/patch.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float kMinScatter = 1e-6F;  ///< m^2
constexpr float kPointSigma = 0.02F;  ///< m, at least, of a map point along the normal
constexpr float kUnknownBend = 0.5F;  ///< 1/m, of a surface nothing is known about
constexpr float kMostVariance = 1.F;  ///< rad^2, of the normal along any axis
constexpr float kMostDoubt = 1.F;     ///< rad
constexpr float kMinFreedom = 1e-3F;  ///< 1 - leverage of a point

/// Symmetric 3x3: xx, xy, xz, yy, yz, zz.
using Upper = std::array<float, 6>;

Vector3f multiply(const Upper& u, const Vector3f& v) {
    return {u[0] * v.x() + u[1] * v.y() + u[2] * v.z(), u[1] * v.x() + u[3] * v.y() + u[4] * v.z(),
            u[2] * v.x() + u[4] * v.y() + u[5] * v.z()};
}

/// A scatter seen in the plane, where it has rank two.
struct InPlane {
    Upper inverse;  ///< pseudo-inverse, m^-2
    float trace;    ///< m^2
    float height;   ///< n . S n, m^2
    Vector3f lean;  ///< S n, m^2
};

/// With B the part of S in the plane: (tr(B) (I - n n^T) - B) / det, det the product of its two
/// eigenvalues, the sum of its principal minors.
inline InPlane in_plane(const Upper& S, const Vector3f& n) {
    const float x = n.x(), y = n.y(), z = n.z();
    const Vector3f Sn = multiply(S, n);
    const float height = x * Sn.x() + y * Sn.y() + z * Sn.z();
    const float lx = Sn.x() - height * x, ly = Sn.y() - height * y, lz = Sn.z() - height * z;
    const float hx = height * x + 2.F * lx, hy = height * y + 2.F * ly, hz = height * z + 2.F * lz;
    const float xx = S[0] - x * hx, yy = S[3] - y * hy, zz = S[5] - z * hz;
    const float xy = S[1] - lx * y - x * (ly + height * y);
    const float xz = S[2] - lx * z - x * (lz + height * z);
    const float yz = S[4] - ly * z - y * (lz + height * z);
    const float trace = xx + yy + zz, raised = trace + kMinScatter;
    const float minors = (xx * yy - xy * xy) + (xx * zz - xz * xz) + (yy * zz - yz * yz);
    const float per_det = 1.F / std::max(minors + kMinScatter * raised, kMinScatter * raised);
    const float k = raised * per_det;
    return {{k * (1.F - x * x) - per_det * xx, -k * x * y - per_det * xy, -k * x * z - per_det * xz,
             k * (1.F - y * y) - per_det * yy, -k * y * z - per_det * yz,
             k * (1.F - z * z) - per_det * zz},
            trace,
            height,
            Sn};
}

/// With no eigenvalue above kMostVariance; the smallest one, that along the normal, is zero.
Upper capped(const Upper& C) {
    Matrix3f m;
    m << C[0], C[1], C[2], C[1], C[3], C[4], C[2], C[4], C[5];
    const Eigen::SelfAdjointEigenSolver<Matrix3f> eigen(m);
    const Matrix3f V = eigen.eigenvectors();
    Vector3f variances = eigen.eigenvalues().cwiseMin(kMostVariance);
    variances[0] = 0.F;
    m = V * variances.asDiagonal() * V.transpose();
    return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
}

int facing_of(const Vector3f& n) {
    const auto quarter = [](float v) {  // sums of comparisons need no branch
        return static_cast<int>(v >= -0.5F) + static_cast<int>(v >= 0.F) +
               static_cast<int>(v >= 0.5F);
    };
    return (quarter(n.x()) * 4 + quarter(n.y())) * 4 + quarter(n.z());
}

/// One coordinate of the five neighbours: four in a register of the vector unit, and the fifth.
struct Five {
    Eigen::Array4f four;
    float last;

    static Five read(const float* at, int stride, float from) {
        const Eigen::Array4f raw(at[0], at[stride], at[2 * stride], at[3 * stride]);
        return {raw - from, at[4 * stride] - from};
    }
    void write(float* to, int stride) const {
        for (int i = 0; i < 4; ++i) to[i * stride] = four[i];
        to[4 * stride] = last;
    }
    float sum() const { return four.sum() + last; }
    friend Five operator+(const Five& a, const Five& b) {
        return {a.four + b.four, a.last + b.last};
    }
    friend Five operator-(const Five& a, const Five& b) {
        return {a.four - b.four, a.last - b.last};
    }
    friend Five operator*(const Five& a, const Five& b) {
        return {a.four * b.four, a.last * b.last};
    }
    friend Five operator*(float a, const Five& b) { return {a * b.four, a * b.last}; }
};

/// Sums over the offsets of the neighbours, h half the squared length of each in the plane.
struct HalfSquares {
    float sum, squares;  ///< of h, h^2
    Vector3f moment;     ///< of h times the offset
};

HalfSquares copy_offsets(const float* xyz, int stride, const Vector3f& n, Patch& patch) {
    const Five x = Five::read(xyz, stride, patch.centroid.x()),
               y = Five::read(xyz + 1, stride, patch.centroid.y()),
               z = Five::read(xyz + 2, stride, patch.centroid.z());
    x.write(patch.offsets.data(), 3);
    y.write(patch.offsets.data() + 1, 3);
    z.write(patch.offsets.data() + 2, 3);
    const Five height = n.x() * x + n.y() * y + n.z() * z;
    const Five h = 0.5F * (x * x + y * y + z * z - height * height);
    return {h.sum(), (h * h).sum(), {(h * x).sum(), (h * y).sum(), (h * z).sum()}};
}

/// Regression of the heights on the half squared distances, from which their own plane is taken.
/// (The rest of a regression is orthogonal to what was taken out, so the heights need not lose
/// theirs.)
inline void find_bend(const HalfSquares& h, const InPlane& plane, const Vector3f& normal,
                      Patch& patch) {
    const Vector3f slope = multiply(plane.inverse, h.moment);
    patch.sag_mean = h.sum / Patch::kCount;
    patch.sag_slope = slope;
    patch.bend_rise = patch.side.sign * (h.moment.dot(normal) - slope.dot(plane.lean));
    patch.bend_run = std::max(h.squares - h.sum * patch.sag_mean - slope.dot(h.moment), 0.F);
}

}  // namespace

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
    const Upper inverse = in_plane(S, normal).inverse;
    constexpr float kLess = 1.F - 1.F / kCount;
    float worst = 0.F, freedom = 1.F;
    Vector3f change = Vector3f::Zero();
    for (int i = 0; i < kCount; ++i) {
        const Vector3f g = multiply(inverse, offset(i));
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

SurfaceSide side_of(const Vector3f& normal, const Vector3f& to_sensor) {
    const float sign = normal.dot(to_sensor) < 0.F ? -1.F : 1.F;
    return {sign, facing_of(sign * normal)};
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
        patch.least_variance = 1.F;
        return;
    }
    patch.forget_doubt();
    patch.side = side;
    patch.centroid = moments.centroid;
    const HalfSquares halves = copy_offsets(xyz, stride, normal, patch);
    const InPlane plane = in_plane(moments.scatter, normal);
    constexpr float kN = Patch::kCount, kFreedom = kN - 3.F;
    const float bend = 0.5F * kUnknownBend * (plane.trace + 2.F * kMinScatter) / kN;
    patch.variance = std::max(kPointSigma * kPointSigma, plane.height / kFreedom) + bend * bend;
    for (std::size_t i = 0; i < 6; ++i) patch.covariance[i] = patch.variance * plane.inverse[i];
    // The scatter's largest eigenvalue is not above its trace.
    patch.least_variance =
        std::min(patch.variance / (plane.trace + 2.F * kMinScatter), kMostVariance);
    const auto& C = patch.covariance;
    if (C[0] + C[3] + C[5] > kMostVariance) patch.covariance = capped(C);
    find_bend(halves, plane, normal, patch);
}

}  // namespace d2lio
