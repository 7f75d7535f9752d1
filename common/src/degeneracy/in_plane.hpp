// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>

#include "d2lio/degeneracy/patch.hpp"

/// The scatter of a patch in its plane and what follows for its normal. T is float, or an array of
/// floats for as many patches.
namespace d2lio::in_plane {

constexpr float kMinScatter = 1e-6F;  ///< m^2
constexpr float kPointSigma = 0.02F;  ///< m, at least, of a map point along the normal
constexpr float kUnknownBend = 0.5F;  ///< 1/m, of a surface nothing is known about
constexpr float kBendPerTrace = 0.5F * kUnknownBend / Patch::kCount;  ///< 1/m
// Above (s^2 + (k T)^2) / T, T the trace, which is not below 2 k s.
static_assert(Patch::kLeastVariance <= 2.00001F * kBendPerTrace * kPointSigma);
constexpr float kMostVariance = 1.F;  ///< rad^2, of the normal along any axis

/// Symmetric 3x3: xx, xy, xz, yy, yz, zz.
template <typename T>
using Upper = std::array<T, 6>;

template <typename T>
struct Vector {
    T x, y, z;
};

inline float larger(float a, float b) { return std::max(a, b); }
template <typename A>
A larger(const A& a, const A& b) {
    return a.max(b);
}

template <typename T>
Vector<T> multiply(const Upper<T>& u, const Vector<T>& v) {
    return {u[0] * v.x + u[1] * v.y + u[2] * v.z, u[1] * v.x + u[3] * v.y + u[4] * v.z,
            u[2] * v.x + u[4] * v.y + u[5] * v.z};
}

template <typename T>
T dot(const Vector<T>& a, const Vector<T>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// Where it has rank two.
template <typename T>
struct Scatter {
    Upper<T> inverse;  ///< pseudo-inverse, m^-2
    T trace;           ///< m^2
    T height;          ///< n . S n, m^2
};

/// With B the part of S in the plane: (tr(B) (I - n n^T) - B) / det, det the product of its two
/// eigenvalues, the sum of its principal minors.
template <typename T>
inline Scatter<T> scatter_of(const Upper<T>& S, const Vector<T>& n, const Vector<T>& Sn) {
    const T &x = n.x, &y = n.y, &z = n.z;
    const T height = x * Sn.x + y * Sn.y + z * Sn.z;
    const T lx = Sn.x - height * x, ly = Sn.y - height * y, lz = Sn.z - height * z;
    const T hx = height * x + 2.F * lx, hy = height * y + 2.F * ly, hz = height * z + 2.F * lz;
    const T xx = S[0] - x * hx, yy = S[3] - y * hy, zz = S[5] - z * hz;
    const T xy = S[1] - lx * y - x * (ly + height * y);
    const T xz = S[2] - lx * z - x * (lz + height * z);
    const T yz = S[4] - ly * z - y * (lz + height * z);
    const T trace = xx + yy + zz, raised = trace + kMinScatter, least = kMinScatter * raised;
    const T minors = (xx * yy - xy * xy) + (xx * zz - xz * xz) + (yy * zz - yz * yz);
    const T det = larger(T(minors + least), least);
    const T per_det = 1.F / det;
    const T k = raised * per_det;
    return {{k * (1.F - x * x) - per_det * xx, -k * x * y - per_det * xy, -k * x * z - per_det * xz,
             k * (1.F - y * y) - per_det * yy, -k * y * z - per_det * yz,
             k * (1.F - z * z) - per_det * zz},
            trace,
            height};
}

/// Of a neighbour's height.
template <typename T>
inline T variance_of(const Scatter<T>& plane) {
    constexpr float kPerFreedom = 1.F / (Patch::kCount - 3.F);
    const T bend = kBendPerTrace * (plane.trace + 2.F * kMinScatter);
    const T left = kPerFreedom * plane.height, least = left * 0.F + kPointSigma * kPointSigma;
    return larger(left, least) + bend * bend;
}

/// Regression of the neighbours' heights on half their squared distances in the plane.
template <typename T>
struct Bend {
    T rise, run;      ///< as in Patch, but for the side
    T mean;           ///< of the half squares, m^2
    Vector<T> slope;  ///< of the plane through them, m
};

/// Their own plane is taken from the half squares. (The rest of a regression is orthogonal to what
/// was taken out, so the heights need not lose theirs.)
/// @param offsets of the neighbours from their centroid.
template <typename T>
inline Bend<T> bend_of(const std::array<Vector<T>, Patch::kCount>& offsets, const Upper<T>& inverse,
                       const Vector<T>& n, const Vector<T>& Sn) {
    T sum = 0.F * n.x, squares = sum;
    Vector<T> moment{sum, sum, sum};
    for (const Vector<T>& o : offsets) {
        const T height = dot(n, o), half = 0.5F * (dot(o, o) - height * height);
        sum += half;
        squares += half * half;
        moment.x += half * o.x;
        moment.y += half * o.y;
        moment.z += half * o.z;
    }
    const Vector<T> slope = multiply(inverse, moment);
    const T mean = sum * (1.F / Patch::kCount), none = 0.F * mean;
    return {dot(moment, n) - dot(slope, Sn),
            larger(T(squares - sum * mean - dot(slope, moment)), none), mean, slope};
}

/// A covariance with no eigenvalue above kMostVariance; the smallest one, that along the normal, is
/// zero.
Upper<float> capped(const Upper<float>& C);

}  // namespace d2lio::in_plane
