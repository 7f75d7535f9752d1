// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/blind.hpp"

#include <cmath>

#include "d2lio/degeneracy/spectrum.hpp"

namespace d2lio {
namespace {

constexpr double kElongation = 4.0;  ///< of P, smallest ratio of its largest variances
constexpr double kDistinct = 0.3;    ///< sine of the least angle between two blind axes
constexpr double kCosCone = 0.966;   ///< cos 15 deg: within it the filter's axis is taken
/// The test of a row is soft: between these multiples of the threshold it fades.
constexpr double kSoftFrom = 0.7, kSoftTo = 1.3;
constexpr double kSpeaks = 0.05;  ///< component from which on a row speaks of a blind direction
constexpr double kSharedWeight = 0.5;  ///< of a row that does

Vec3 steadied(const Vec3& axis, const BlockSpectrum& P) {
    const Vec3 longest = P.v.col(2);
    const bool elongated = P.lambda[2] > kElongation * P.lambda[1];
    return elongated && std::abs(longest.dot(axis)) > kCosCone ? longest : axis;
}

/// What of an axis is orthogonal to the first `count` ones.
Vec3 rest_of(Vec3 axis, const BlindDirections& blind, int count) {
    for (int j = 0; j < count; ++j) {
        const Vec3 other = blind.axes.col(j);
        axis -= axis.dot(other) * other;
    }
    return axis;
}

}  // namespace

void SurfaceSums::add(const Vec3& normal, const Patch& patch) {
    const Vec3 a = patch.s1.cast<double>(), b = patch.s2.cast<double>();
    information.noalias() += normal * normal.transpose();
    noise.noalias() += a * a.transpose();
    noise.noalias() += b * b.transpose();
}

BlindDirections find_blind(const NoiseShare& share, const Mat3& P_t,
                           const NoiseAwareConfig& config) {
    BlindDirections out;
    for (int i = 0; i < 3; ++i) {
        const double blend = smooth_step(share.share[i], config.share_low, config.share_high);
        if (!(blend > 0.0)) continue;
        out.axes.col(out.count) = share.axes.col(i);
        out.blend[out.count++] = blend;
    }
    if (out.count > 0) out.axes.col(0) = steadied(out.axes.col(0), decompose(P_t));
    const Vec3 own = share.axes.col(0);
    for (int i = 1; i < out.count; ++i) {  // Gram-Schmidt: cleaning one leaves the others clean
        Vec3 d = rest_of(out.axes.col(i), out, i);
        // The filter's axis lay on this one: then the scan's own first axis is what is left.
        const Vec3 left = rest_of(own, out, i);
        if (d.norm() < kDistinct && left.norm() > d.norm()) d = left;
        out.axes.col(i) = d.normalized();
    }
    return out;
}

CleanedRow cleaned_row(const Vec3& normal, const Patch& patch, const BlindDirections& blind,
                       const NoiseAwareConfig& config) {
    CleanedRow out{normal, 1.0};
    const double k = config.significance * config.significance;
    double proven = 0.0;
    for (int i = 0; i < blind.count; ++i) {
        const Vec3 d = blind.axes.col(i);
        const double a = out.normal.dot(d);
        const double limit = k * patch.variance_along(d, a);
        const bool clear = a * a >= kSoftTo * limit;
        const double kept = clear ? 1.0 : smooth_step(a * a / limit, kSoftFrom, kSoftTo);
        out.normal -= blind.blend[i] * (1.0 - kept) * a * d;
        proven += blind.blend[i] * kept * kept * a * a;
    }
    const double speaks = proven / (kSpeaks * kSpeaks);
    out.weight = 1.0 - (1.0 - kSharedWeight) * speaks / (1.0 + speaks);
    return out;
}

}  // namespace d2lio
