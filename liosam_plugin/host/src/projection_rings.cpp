// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "projection_rings.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace d2lio::liosam {
namespace {

bool is_finite(const LidarPoint& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// Rises with the azimuth from 0 at +x to 4 after a full turn, 2 per half turn from anywhere: as
/// good as the angle for telling jumps of more than half a turn, and much cheaper.
float diamond_angle(const LidarPoint& p) {
    const float norm = std::abs(p.x) + std::abs(p.y);
    if (!(norm > 0.0F)) return 0.0F;
    const float along = p.x / norm;
    return p.y >= 0.0F ? 1.0F - along : 3.0F + along;
}

constexpr float kHalfTurn = 2.0F;  // in diamond angles

/// +1 where most steps shorter than half a turn are counter-clockwise, -1 otherwise.
float sense_of_rotation(const std::vector<LidarPoint>& points) {
    std::ptrdiff_t counter_clockwise = 0;
    float last = 0.0F;
    for (const LidarPoint& p : points) {
        if (!is_finite(p)) continue;
        const float step = diamond_angle(p) - last;
        last += step;
        if (std::abs(step) > kHalfTurn || step == 0.0F) continue;
        counter_clockwise += step > 0.0F ? 1 : -1;
    }
    return counter_clockwise >= 0 ? 1.0F : -1.0F;
}

}  // namespace

bool has_rings(const std::vector<LidarPoint>& points) {
    return std::any_of(points.begin(), points.end(),
                       [](const LidarPoint& p) { return p.ring != 0; });
}

int assign_rings_by_turns(std::vector<LidarPoint>& points) {
    const float sense = sense_of_rotation(points);
    int ring = -1;
    float last = 0.0F;
    for (LidarPoint& p : points) {
        p.ring = kNoRing;
        if (!is_finite(p)) continue;
        const float angle = diamond_angle(p);
        if (ring < 0 || (angle - last) * sense < -kHalfTurn) ++ring;
        last = angle;
        p.ring = static_cast<std::uint16_t>(std::min<int>(ring, kNoRing));
    }
    return ring + 1;
}

}  // namespace d2lio::liosam
