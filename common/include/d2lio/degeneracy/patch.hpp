// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "d2lio/geometry/plane.hpp"

namespace d2lio {

/// Number of bins of SurfaceSide::facing: the normal that looks at the sensor, its three components
/// quartered.
constexpr int kFacings = 64;

/// Which side of a plane the sensor sees.
struct SurfaceSide {
    float sign = 1.F;  ///< 1: the fitted normal looks at the sensor, -1: away from it
    int facing = 0;    ///< bin of the direction the surface faces
};

/// @param to_sensor from any point of the plane.
inline SurfaceSide side_of(const Eigen::Vector3f& normal, const Eigen::Vector3f& to_sensor) {
    const float sign = normal.dot(to_sensor) < 0.F ? -1.F : 1.F;
    const auto quarter = [sign](float v) {  // sums of comparisons need no branch
        const float u = sign * v;
        return static_cast<int>(u >= -0.5F) + static_cast<int>(u >= 0.F) +
               static_cast<int>(u >= 0.5F);
    };
    return {sign, (quarter(normal.x()) * 4 + quarter(normal.y())) * 4 + quarter(normal.z())};
}

/// What the neighbours of a plane fit say about the surface beside its plane: how uncertain the
/// normal is, and how the surface bends. Map frame, m.
struct Patch {
    static constexpr int kCount = 5;  ///< neighbours
    /// rad^2. No direction in the plane has a smaller formal_variance(): neighbours that lie
    /// farther apart fix the normal better, but leave more room for a bend.
    static constexpr float kLeastVariance = 0.002F;

    Eigen::Vector3f centroid = Eigen::Vector3f::Zero();
    std::array<float, 3 * kCount> offsets{};  ///< of the neighbours from the centroid
    float variance = 0.F;                     ///< of a neighbour's height
    /// Covariance of the unit normal, which lies in the plane: xx, xy, xz, yy, yz, zz; rad^2.
    std::array<float, 6> covariance{};
    /// Regression of the neighbours' distances from the plane on their squared distances from the
    /// centroid: the bend is bend_rise / bend_run (1/m), its variance sigma^2 / bend_run.
    float bend_rise = 0.F;  ///< m^3
    float bend_run = 0.F;   ///< m^4
    /// Plane fit of half the squared in-plane distance, which a bent surface adds to its plane.
    float sag_mean = 0.F;                                 ///< m^2
    Eigen::Vector3f sag_slope = Eigen::Vector3f::Zero();  ///< m, in the plane
    SurfaceSide side;

    /// What leaving out the most decisive neighbour adds to the covariance: doubt doubt^T; rad.
    /// Found at the first call, of which there may be one at a time.
    /// @param normal the one the patch was made with.
    const Eigen::Vector3f& doubt(const Eigen::Vector3f& normal) const {
        if (!doubt_known_) doubt_ = find_doubt(normal);
        doubt_known_ = true;
        return doubt_;
    }
    void forget_doubt() { doubt_known_ = false; }
    /// Variance of n . d for a direction d (unit), without doubt.
    float formal_variance(const Eigen::Vector3f& d) const {
        const auto& [xx, xy, xz, yy, yz, zz] = covariance;
        return d.x() * (xx * d.x() + 2.F * (xy * d.y() + xz * d.z())) +
               d.y() * (yy * d.y() + 2.F * yz * d.z()) + zz * d.z() * d.z();
    }
    /// Doubt included; with a second-order term, so that a normal that is uncertain by more than
    /// half a radian says nothing about any direction. Never below formal_variance().
    double variance_along(const Eigen::Vector3d& d, const Eigen::Vector3d& normal) const;
    /// Distance of a surface of unit bend from the fitted plane at p (m^2); multiply by the bend.
    float sag(const Eigen::Vector3f& normal, const Eigen::Vector3f& p) const {
        const Eigen::Vector3f d = p - centroid;
        const float off = normal.dot(d);
        return 0.5F * (d.squaredNorm() - off * off) - sag_mean - sag_slope.dot(d);
    }

  private:
    Eigen::Vector3f find_doubt(const Eigen::Vector3f& normal) const;

    mutable Eigen::Vector3f doubt_ = Eigen::Vector3f::Zero();
    mutable bool doubt_known_ = false;
};

/// Patch of a plane fitted to `count` points.
///
/// The covariance of a fitted normal is sigma^2 S^-1 in the plane, S the neighbours' scatter there,
/// sigma the larger of 2 cm and the fit's own residual, plus what a bend of 0.5 / m would add. The
/// doubt is the worst that leaving out any one neighbour does: where a single point decides on the
/// plane (four points of a scan line and one beside it), nothing is known of the surface.
/// (Sherman-Morrison on S; the propagation is that of Hatleskog, Alexis, "Probabilistic degeneracy
/// detection for point-to-plane error minimization", 2024, with map noise instead of scan noise.)
/// @param moments of the points. @param normal of the fitted plane, unit length.
/// @param count of the points; with fewer than Patch::kCount nothing is known, the rest is left
/// out.
void make_patch(const float* xyz, int stride, int count, const PlaneMoments& moments,
                const Eigen::Vector3f& normal, const SurfaceSide& side, Patch& patch);

}  // namespace d2lio
