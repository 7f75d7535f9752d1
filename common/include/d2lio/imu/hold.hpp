// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/geometry/state.hpp"

namespace d2lio {

/// Kalman update with a body at rest: pose as given (1 mm, 0.1 mrad), velocity zero (1 mm/s).
/// Biases and gravity learn from it. A state that would not stay finite is left as it was.
void hold_still(const Pose& rest, NavState& x, Mat23x23& P);

/// Makes the attitude known (1 mrad) and independent of the rest: the map begins with it.
void anchor_attitude(Mat23x23& P);

/// FAST-LIO2's covariance of a state that was started from readings at rest.
Mat23x23 start_covariance();

}  // namespace d2lio
