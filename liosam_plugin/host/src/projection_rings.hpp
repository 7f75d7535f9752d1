// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio::liosam {

/// Ring of a point that fits none; `Projection` drops and counts it.
constexpr std::uint16_t kNoRing = std::numeric_limits<std::uint16_t>::max();

/// Whether a scan tells its rings apart: false where every index is 0, as in clouds without that
/// field and from sensors of one ring.
bool has_rings(const std::vector<LidarPoint>& points);

/// Sets each point's ring from the message order where rings follow one another, each a turn that
/// begins straight ahead (+x), as in KITTI's HDL-64E clouds: the azimuth in [0, 2 pi) falls back by
/// more than half a turn between rings. Either sense of rotation. Ring 0 is the first of the
/// message (at KITTI the top one); non-finite points get kNoRing.
/// @return number of rings found. More than the sensor has: the message is in another order.
int assign_rings_by_turns(std::vector<LidarPoint>& points);

}  // namespace d2lio::liosam
