// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

enum class ImuCheckStatus {
    kOk,
    kTooFew,       ///< fewer samples than asked for
    kNotFinite,    ///< NaN or Inf
    kConstant,     ///< every reading identical: a dead or simulated sensor without noise
    kNoGravity,    ///< accelerometer reads about zero: gravity removed, or not connected
    kInG,          ///< accelerometer reads about 1: unit is g, not m/s^2
    kImplausible,  ///< neither
    kSaturated     ///< an axis sticks at its extreme value
};

struct ImuCheckOptions {
    std::size_t samples = 100;         ///< taken from the start, near standstill
    double gravity = 9.81;             ///< m/s^2
    double gravity_tolerance = 1.0;    ///< m/s^2
    double no_gravity_below = 0.2;     ///< m/s^2
    std::size_t saturation_run = 3;    ///< consecutive identical extreme readings
    double saturation_gyro = 4.3;      ///< rad/s: just below the smallest usual range, 250 deg/s
    double saturation_accel_g = 1.95;  ///< g: just below the smallest usual range, 2 g
};

/// Outcome of the start-up check.
struct ImuCheck {
    ImuCheckStatus status = ImuCheckStatus::kTooFew;
    std::size_t samples = 0;        ///< looked at
    double mean_accel_norm = 0.0;   ///< mean of |accel|, as stored (m/s^2 or g)
    double mean_gyro_norm = 0.0;    ///< mean of |gyro|, rad/s
    double saturated_value = 0.0;   ///< the extreme reading, as stored
    std::size_t saturated_run = 0;  ///< longest run at it

    bool ok() const { return status == ImuCheckStatus::kOk; }
};

/// Looks at the first `options.samples` samples and names one fault, the one nearest to the cause.
/// Reports only: scaling is the host's business.
ImuCheck check_imu(const std::vector<ImuSample>& samples, const ImuCheckOptions& options = {});

/// One line for the user.
std::string to_string(const ImuCheck& check);

}  // namespace d2lio
