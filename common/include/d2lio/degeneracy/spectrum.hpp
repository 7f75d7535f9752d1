// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

namespace d2lio {

/// Eigenvalues (ascending) and eigenvectors (columns) of one 3x3 information block A^T A. A is not
/// divided by the measurement noise, so for translation lambda counts points.
struct BlockSpectrum {
    Vec3 lambda = Vec3::Zero();
    Mat3 v = Mat3::Identity();  ///< each column's largest component is positive

    /// V diag(f(lambda_i)) V^T.
    template <typename F>
    Mat3 apply(const F& f) const {
        return v * Vec3(f(lambda[0]), f(lambda[1]), f(lambda[2])).asDiagonal() * v.transpose();
    }
    /// Number of leading (smallest) eigenvalues below `share` of the trace.
    int weak_count(double share) const;
};

/// Both blocks: their units differ (m^2 and 1), so they are never mixed (paper, section III-E).
struct Spectrum {
    BlockSpectrum rotation;     ///< tangent of the body, lambda in m^2
    BlockSpectrum translation;  ///< map frame, lambda dimensionless
};

/// Decomposes a symmetric 3x3 block; rounding may leave eigenvalues at -epsilon, they come out as
/// 0. A block with non-finite entries gives lambda = 0 and the identity.
BlockSpectrum decompose(const Mat3& information);

}  // namespace d2lio
