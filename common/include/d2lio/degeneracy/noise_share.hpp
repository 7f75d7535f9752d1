// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

namespace d2lio {

/// Directions of a 3x3 information block by how much of their information is noise.
struct NoiseShare {
    Vec3 share = Vec3::Zero();     ///< of each direction, descending; 1: all of it may be noise
    Mat3 axes = Mat3::Identity();  ///< columns, unit length, not orthogonal in general
};

/// Generalised eigenpairs of (noise, information).
///
/// With rows n_i + e_i, e_i of covariance C_i, the expectation of sum (n_i + e_i)(n_i + e_i)^T is
/// the true information plus sum C_i: where the second is as large as what was measured, nothing
/// shows that the direction is constrained at all. The ratio does not change with the units of the
/// block, so it needs no threshold in points or metres.
/// @param information sum of n n^T as measured; @param noise sum of the C_i. Anything not finite
/// gives shares of 0.
NoiseShare noise_share(const Mat3& information, const Mat3& noise);

/// 0 below `low`, 1 above `high`, smooth between (cubic).
double smooth_step(double x, double low, double high);

}  // namespace d2lio
