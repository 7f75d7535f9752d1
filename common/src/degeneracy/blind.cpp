// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/blind.hpp"

#include <algorithm>
#include <cmath>

#include "d2lio/degeneracy/spectrum.hpp"

namespace d2lio {
namespace {

constexpr double kElongation = 4.0;  ///< of P, smallest ratio of its largest variances
constexpr double kDistinct = 0.3;    ///< sine of the least angle between two blind axes
constexpr double kCosCone = 0.966;   ///< cos 15 deg: within it the filter's axis is taken
constexpr double kWavering = 0.5;    ///< blend above which a direction that was blind stays so
constexpr double kSameAxis = 0.9;    ///< cosine between the axes of one direction in two scans
/// The test of a row is soft: between these multiples of the threshold it fades.
constexpr double kSoftFrom = 0.7, kSoftTo = 1.3;
constexpr double kSpeaks = 0.05;  ///< component from which on a row speaks of a blind direction
constexpr double kSharedWeight = 0.5;  ///< of a row that does, if it is the only one
/// Of a filter that takes the map for the truth: its errors are 4 to 9 times its sigma.
constexpr double kOverConfidence = 5.0 * 5.0;
constexpr double kMapVariance = 0.03 * 0.03;  ///< m^2, of the map along a blind direction
constexpr double kSurprise = 3.0;             ///< sigmas at which a row's weight is halved
constexpr double kFew = 20.0;                 ///< rows' worth of proven information that is little

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

Mat3 SurfaceSums::symmetric(const Upper& u) {
    Eigen::Matrix3f m;
    m << u.xx, u.xy, u.xz, u.xy, u.yy, u.yz, u.xz, u.yz, u.zz;
    return m.cast<double>();
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
    for (int i = 0; i < out.count; ++i) {
        const Vec3 d = out.axes.col(i);
        out.variance[i] = std::max(d.dot(P_t * d), 0.0);
    }
    return out;
}

void stay_blind(const BlindDirections& before, BlindDirections& now) {
    for (int i = 0; i < now.count; ++i) {
        if (!(now.blend[i] > kWavering)) continue;
        for (int j = 0; j < before.count; ++j) {
            const bool same = std::abs(now.axes.col(i).dot(before.axes.col(j))) > kSameAxis;
            if (same) now.blend[i] = std::max(now.blend[i], before.blend[j]);
        }
    }
}

ProofTest::ProofTest(const BlindDirections& blind, const NoiseAwareConfig& config)
    : axes_(blind.axes.cast<float>()),
      count_(blind.count),
      // A little less than the test itself asks for: single precision decides nothing here.
      least_(0.99F * static_cast<float>(kSoftFrom * config.significance * config.significance)) {}

Vec3 proven_share(const Vec3& normal, const Patch& patch, const BlindDirections& blind,
                  const NoiseAwareConfig& config) {
    const double k = config.significance * config.significance;
    Vec3 share = Vec3::Zero();
    for (int i = 0; i < blind.count; ++i) {
        const Vec3 d = blind.axes.col(i);
        const double square = std::pow(normal.dot(d), 2);
        const double limit = k * patch.variance_along(d, normal);
        const bool clear = square >= kSoftTo * limit;  // also of a fit without any uncertainty
        share[i] = clear ? 1.0 : smooth_step(square / limit, kSoftFrom, kSoftTo);
    }
    return share;
}

void ProvenSum::add(const Vec3& normal, const Vec3& share, const BlindDirections& blind) {
    for (int i = 0; i < blind.count; ++i) {
        const double a = share[i] * normal.dot(blind.axes.col(i));
        information[i] += a * a;
    }
}

double trust(double residual, const Vec3& normal, const Patch& patch, const BlindDirections& blind,
             double variance) {
    double S = variance + static_cast<double>(patch.variance);
    for (int i = 0; i < blind.count; ++i) {
        const double a = normal.dot(blind.axes.col(i));
        S += a * a * (kOverConfidence * blind.variance[i] + kMapVariance);
    }
    const double allowed = kSurprise * kSurprise * S;
    const double out = allowed / (allowed + residual * residual);
    return std::isfinite(out) ? out : 0.0;
}

CleanedRow cleaned_row(const Vec3& normal, const Vec3& share, const BlindDirections& blind,
                       const ProvenSum& sum, double trusted) {
    CleanedRow out{without(normal, blind, share), 1.0};
    double speaks = 0.0, alone = 0.0;
    for (int i = 0; i < blind.count; ++i) {
        const double a = normal.dot(blind.axes.col(i));
        const double proven = blind.blend[i] * share[i] * share[i] * a * a;
        speaks += proven;
        alone += proven * kFew / (kFew + sum.information[i]);
    }
    const double all = kSpeaks * kSpeaks + speaks;
    out.weight = 1.0 - (1.0 - kSharedWeight) * alone / all;
    out.weight *= 1.0 - (1.0 - trusted) * speaks / all;
    return out;
}

}  // namespace d2lio
