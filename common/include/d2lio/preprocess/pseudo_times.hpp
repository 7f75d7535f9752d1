// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

/// Estimates point times of a spinning LiDAR from the azimuths, assuming a constant rate and a
/// sweep that starts at the first return in message order; the sense of rotation is found. For
/// clouds without a time field only; worth a degree or two, not for solid-state scan patterns.
/// @param points in message order, LiDAR frame (m), with ring indices where there are several
/// @param period_s duration of a full turn, s, in (0, 2]
/// @param dt_ns out: offset from the earliest point, ns; 0 for points without a direction
/// @return false (and all offsets 0) when the sense of rotation cannot be told
bool pseudo_times_by_azimuth(const std::vector<LidarPoint>& points, double period_s,
                             std::vector<std::int32_t>& dt_ns);

}  // namespace d2lio
