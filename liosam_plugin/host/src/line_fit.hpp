// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace d2lio::liosam {

/// A line through `point` along the unit vector `direction`, map frame, m.
struct Line {
    Eigen::Vector3f point = Eigen::Vector3f::Zero();
    Eigen::Vector3f direction = Eigen::Vector3f::UnitX();

    /// Unit vector from the line to q, at right angles to it; any such vector for q on the line.
    Eigen::Vector3f away_from(const Eigen::Vector3f& q) const;
};

/// The line through the points' centroid along their largest spread. False unless that spread's
/// eigenvalue is more than three times the next one (LOAM, LIO-SAM), or for non-finite points.
/// @param xyz first coordinate of the first point; points are `stride` floats apart.
bool fit_line(const float* xyz, int stride, int count, Line& line);

}  // namespace d2lio::liosam
