// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "d2lio/degeneracy/noise_share.hpp"
#include "d2lio/degeneracy/patch.hpp"

namespace d2lio {

/// Parameters of method noise_aware.
struct NoiseAwareConfig {
    double share_low = 0.2;     ///< of noise in a direction's information: below, nothing is done
    double share_high = 0.4;    ///< above, every row has to prove itself
    double significance = 6.0;  ///< sigmas by which a row's component must exceed its noise
};

/// Directions of translation that noise may dominate, and how far the rows are to be cleaned there.
struct BlindDirections {
    int count = 0;
    Mat3 axes = Mat3::Identity();  ///< columns, map frame, orthonormal; the first `count` matter
    Vec3 blend = Vec3::Zero();     ///< 0: leave the rows alone, 1: clean them
    Vec3 variance = Vec3::Zero();  ///< of the predicted position along each axis, m^2
};

/// Tells at little cost the many rows of which proven_share() is zero.
class ProofTest {
  public:
    ProofTest(const BlindDirections& blind, const NoiseAwareConfig& config);
    bool may_pass(const Eigen::Vector3f& normal, const Patch& patch) const {
        for (int i = 0; i < count_; ++i) {
            const auto d = axes_.col(i);
            const float a = normal.dot(d);
            if (a * a > least_ * patch.formal_variance(d)) return true;
        }
        return false;
    }
    /// Tells most rows without their patch: 1 - a^2 of a direction's square lies in the plane.
    bool may_pass(const Eigen::Vector3f& normal) const {
        const float bound = least_ * Patch::kLeastVariance;
        for (int i = 0; i < count_; ++i) {
            const float a = normal.dot(axes_.col(i)), square = a * a;
            if (square > bound * (1.F - square)) return true;
        }
        return false;
    }

  private:
    Eigen::Matrix3f axes_;
    int count_;
    float least_;  ///< ratio of a component's square to its variance
};

/// A row's normal without its components along the blind directions, as far as those are cleaned.
/// @param share of each component that has proven itself, and stays.
inline Vec3 without(const Vec3& normal, const BlindDirections& blind,
                    const Vec3& share = Vec3::Zero()) {
    Vec3 out = normal;
    for (int i = 0; i < blind.count; ++i) {
        const auto d = blind.axes.col(i);
        out -= blind.blend[i] * (1.0 - share[i]) * normal.dot(d) * d;
    }
    return out;
}

/// How much of a row's components along the blind directions exceeds their noise: 0 none, 1 all.
Vec3 proven_share(const Vec3& normal, const Patch& patch, const BlindDirections& blind,
                  const NoiseAwareConfig& config);

/// Information along the blind directions that has proven itself, summed over the rows.
struct ProvenSum {
    Vec3 information = Vec3::Zero();  ///< along each blind axis

    void add(const Vec3& normal, const Vec3& share, const BlindDirections& blind);
};

/// Sums over the accepted rows; see noise_share(). In single precision: good for a share.
class SurfaceSums {
  public:
    Mat3 information() const { return symmetric(n_); }  ///< of n n^T
    Mat3 noise() const { return symmetric(c_); }        ///< of the covariances of the normals

    void add(const Vec3& normal, const Patch& patch) {
        const auto x = static_cast<float>(normal.x()), y = static_cast<float>(normal.y()),
                   z = static_cast<float>(normal.z());
        add({x * x, x * y, x * z, y * y, y * z, z * z}, patch.covariance);
    }
    /// @param n, c of other rows; xx, xy, xz, yy, yz, zz.
    void add(const std::array<float, 6>& n, const std::array<float, 6>& c) {
        n_.add(n[0], n[1], n[2], n[3], n[4], n[5]);
        c_.add(c[0], c[1], c[2], c[3], c[4], c[5]);
    }

  private:
    /// Scalars, which a loop keeps in registers.
    struct Upper {
        float xx = 0.F, xy = 0.F, xz = 0.F, yy = 0.F, yz = 0.F, zz = 0.F;
        void add(float a, float b, float c, float d, float e, float f) {
            xx += a;
            xy += b;
            xz += c;
            yy += d;
            yz += e;
            zz += f;
        }
    };
    static Mat3 symmetric(const Upper& u);

    Upper n_, c_;
};

/// Finds the directions to clean.
///
/// The axis of a blind direction is taken from the filter, not from the scan, where both agree (to
/// 15 degrees): the scan's own axis wobbles by a degree from scan to scan, and a direction that is
/// cleaned along one axis and long uncertain along another would be measured by the difference,
/// with the certainty of the well-seen directions. Along the long axis of P nothing leaks.
/// @param P_t covariance of the predicted position, map frame, m^2.
BlindDirections find_blind(const NoiseShare& share, const Mat3& P_t,
                           const NoiseAwareConfig& config);

/// A direction that was blind in the scan before stays as blind as it was while its share is in the
/// upper half between config.share_low and share_high: what leaks in while it wavers would claim to
/// be a measurement, and move the map along.
void stay_blind(const BlindDirections& before, BlindDirections& now);

/// Weight of a row that speaks of a blind direction, by how well its residual agrees with the
/// prediction: 1 / (1 + r^2 / (9 S)), the kernel of Geman and McClure (1987) at three sigmas, S the
/// variance of the row, of its patch, and of prediction (five times the filter's sigma, which is
/// too small) and map (3 cm) along the blind directions.
/// A plane through neighbours of two surfaces is wrong by decimetres, and the only one to speak;
/// scan after scan it would pull the pose along.
/// @param residual m. @param variance of a row's residual, m^2.
double trust(double residual, const Vec3& normal, const Patch& patch, const BlindDirections& blind,
             double variance);

/// A row after cleaning.
struct CleanedRow {
    Vec3 normal;          ///< map frame, not of unit length where a component went
    double weight = 1.0;  ///< of the whole row, normal and residual
};

/// The row without what noise may have put into it: along each blind direction the component of its
/// normal goes unless it exceeds its own uncertainty by config.significance sigmas. The residual
/// stays as it is: at the point of linearisation the neighbours lie beside the point, wherever that
/// is along the blind direction.
///
/// Where a direction hangs on a few proven rows, they get half the weight, down from a component of
/// about 0.05 on: scan after scan sees the same few surfaces, with the same error each time. Among
/// many that averages out.
/// @param share of proven_share(). @param sum over all rows of the scan. @param trusted of trust(),
/// which counts as far as the row speaks of a blind direction.
CleanedRow cleaned_row(const Vec3& normal, const Vec3& share, const BlindDirections& blind,
                       const ProvenSum& sum, double trusted);

}  // namespace d2lio
