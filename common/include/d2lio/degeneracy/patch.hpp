// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

namespace d2lio {

/// What the neighbours of a plane fit say about the surface beside its plane: how uncertain the
/// normal is, and how the surface bends. Map frame, m.
struct Patch {
    Eigen::Vector3f centroid = Eigen::Vector3f::Zero();
    /// Covariance of the unit normal, which lies in the plane: xx, xy, xz, yy, yz, zz; rad^2.
    std::array<float, 6> covariance{};
    /// What leaving out the most decisive neighbour adds to it: doubt doubt^T; rad.
    Eigen::Vector3f doubt = Eigen::Vector3f::Zero();
    /// Regression of the neighbours' distances from the plane on their squared distances from the
    /// centroid: the bend is bend_rise / bend_run (1/m), its variance sigma^2 / bend_run.
    float bend_rise = 0.F;  ///< m^3
    float bend_run = 0.F;   ///< m^4
    /// Plane fit of half the squared in-plane distance, which a bent surface adds to its plane.
    float sag_mean = 0.F;                                 ///< m^2
    Eigen::Vector3f sag_slope = Eigen::Vector3f::Zero();  ///< m, in the plane
    float side = 1.F;  ///< 1: the fitted normal looks at the sensor, -1: away from it
    int facing = 0;    ///< bin of the direction the surface faces

    /// Variance of n . d for a direction d (unit), doubt included; with a second-order term, so
    /// that a normal that is uncertain by more than half a radian says nothing about any direction.
    /// @param a n . d of the fitted normal.
    double variance_along(const Eigen::Vector3d& d, double a) const;
    /// Distance of a surface of unit bend from the fitted plane at p (m^2); multiply by the bend.
    float sag(const Eigen::Vector3f& normal, const Eigen::Vector3f& p) const;
};

/// Number of bins of Patch::facing: the normal that looks at the sensor, its three components
/// quartered.
constexpr int kFacings = 64;

/// Patch of a plane fitted to `count` points.
///
/// The covariance of a fitted normal is sigma^2 S^-1 in the plane, S the neighbours' scatter there,
/// sigma the larger of 2 cm and the fit's own residual, plus what a bend of 0.5 / m would add. The
/// doubt is the worst that leaving out any one neighbour does: where a single point decides on the
/// plane (four points of a scan line and one beside it), nothing is known of the surface.
/// (Sherman-Morrison on S; the propagation is that of Hatleskog, Alexis, "Probabilistic degeneracy
/// detection for point-to-plane error minimization", 2024, with map noise instead of scan noise.)
/// @param normal of the fitted plane, unit length. @param sensor where the surface is seen from.
Patch make_patch(const float* xyz, int stride, int count, const Eigen::Vector3f& normal,
                 const Eigen::Vector3f& sensor);

}  // namespace d2lio
