// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "d2lio/types.hpp"

namespace d2lio {

/// Largest deviation of a singular value from 1: what rounding every entry to three decimals, as
/// calibration files do, can cause (3 x 0.0005).
constexpr double kRotationTolerance = 1.5e-3;

/// The rotation nearest to a calibration's 3x3 block (orthogonal Procrustes, by SVD).
/// @param key name of the configuration entry, for the message
/// @throws ConfigError with the determinant if R is not finite, is a reflection, or deviates from
///         orthonormal by more than `tolerance`
Mat3 checked_rotation(const Mat3& R, const std::string& key, double tolerance = kRotationTolerance);

/// T_imu_lidar (or any extrinsic) with its rotation checked as above and a finite translation (m).
/// @throws ConfigError
Pose checked_extrinsic(const Mat3& R, const Vec3& t, const std::string& key);

}  // namespace d2lio
