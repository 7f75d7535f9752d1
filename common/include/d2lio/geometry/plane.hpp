// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

namespace d2lio {

/// Plane n . x + d = 0 with unit normal n (map frame), d in m.
struct Plane {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float d = 0.F;

    bool operator==(const Plane& o) const { return normal == o.normal && d == o.d; }
    float signed_distance(const Eigen::Vector3f& p) const { return normal.dot(p) + d; }
};

enum class PlaneStatus {
    kOk,
    kSingular,  ///< points coincide, lie on a line, or no plane n . x = -1 exists
    kRough,     ///< some point lies farther from the plane than allowed
};

struct PlaneFitOptions {
    float max_distance = 0.1F;  ///< m, of every point from the plane (FAST-LIO2: 0.1)
    /// Smallest ratio of the middle to the largest eigenvalue of the scatter; 0 switches the check
    /// off (FAST-LIO2 has none).
    double min_spread_ratio = 1e-4;
};

/// First and second moments of the points of a fit.
struct PlaneMoments {
    Eigen::Vector3f centroid = Eigen::Vector3f::Zero();  ///< m
    /// About the centroid, not divided by the number of points: xx, xy, xz, yy, yz, zz; m^2.
    std::array<float, 6> scatter{};

    float trace() const { return scatter[0] + scatter[3] + scatter[5]; }
};

/// Fits the plane that minimises sum_i (u . x_i + 1)^2, the form FAST-LIO2 uses, in closed form.
/// With centroid c, scatter S of N points: u is parallel to S^-1 c (Sherman-Morrison on
/// S + N c c^T), evaluated through the adjugate of S, so that exact planes and coordinates far from
/// the origin lose no digits.
/// @param xyz first coordinate of the first point; points are `stride` floats apart, map frame, m.
/// @param moments where to put those of three points or more, whatever becomes of the fit.
PlaneStatus fit_plane(const float* xyz, int stride, int count, const PlaneFitOptions& options,
                      Plane& plane, PlaneMoments* moments = nullptr);

}  // namespace d2lio
