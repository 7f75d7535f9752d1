// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/pseudo_times.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace d2lio {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kTurn = 2.0 * kPi;
constexpr double kMaxStep = 0.5;  // rad between returns of a ring that still tells the sense
// Beams of one firing differ a little in azimuth: a ring that begins this much short of a full
// turn began before the first return instead, rad.
constexpr double kStartSlack = 0.2;
constexpr double kMaxSeconds = 2.1;  // offsets are 32-bit nanoseconds

bool has_direction(const LidarPoint& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && (p.x != 0.F || p.y != 0.F);
}

double azimuth(const LidarPoint& p) {
    return std::atan2(static_cast<double>(p.y), static_cast<double>(p.x));
}

double in_turn(double angle) { return angle - kTurn * std::floor(angle / kTurn); }

std::size_t ring_count(const std::vector<LidarPoint>& points) {
    std::size_t count = 0;
    for (const LidarPoint& p : points) count = std::max(count, std::size_t{p.ring} + 1);
    return count;
}

// Majority of small azimuth steps within the rings: +1 counter-clockwise, -1, or 0 for none.
int sense_of_rotation(const std::vector<LidarPoint>& points, std::size_t rings) {
    std::vector<double> last(rings, std::numeric_limits<double>::quiet_NaN());
    long votes = 0;
    for (const LidarPoint& p : points) {
        if (!has_direction(p)) continue;
        const double now = azimuth(p);
        const double step = std::remainder(now - last[p.ring], kTurn);
        if (std::abs(step) < kMaxStep && step != 0.0) votes += step > 0.0 ? 1 : -1;
        last[p.ring] = now;
    }
    return (votes > 0) - (votes < 0);
}

// Angle swept since the first return, unwrapped along each ring.
std::vector<double> swept_angles(const std::vector<LidarPoint>& points, std::size_t rings,
                                 int sense) {
    constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> last(rings, kUnseen), swept(points.size(), kUnseen);
    double start = kUnseen;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!has_direction(points[i])) continue;
        if (std::isnan(start)) start = azimuth(points[i]);
        double& previous = last[points[i].ring];
        double angle = in_turn(sense * (azimuth(points[i]) - start));
        if (std::isnan(previous)) {
            if (angle > kTurn - kStartSlack) angle -= kTurn;
        } else if (angle < previous - kPi) {
            angle += kTurn;
        } else if (angle > previous + kTurn - kStartSlack) {
            angle -= kTurn;
        }
        swept[i] = previous = angle;
    }
    return swept;
}

}  // namespace

bool pseudo_times_by_azimuth(const std::vector<LidarPoint>& points, double period_s,
                             std::vector<std::int32_t>& dt_ns) {
    dt_ns.assign(points.size(), 0);
    const std::size_t rings = ring_count(points);
    const int sense = sense_of_rotation(points, rings);
    if (sense == 0 || !(period_s > 0.0)) return false;
    const std::vector<double> swept = swept_angles(points, rings, sense);
    double first = std::numeric_limits<double>::infinity();
    for (const double angle : swept) first = std::isnan(angle) ? first : std::min(first, angle);
    for (std::size_t i = 0; i < swept.size(); ++i) {
        if (std::isnan(swept[i])) continue;
        const double seconds = std::min((swept[i] - first) / kTurn * period_s, kMaxSeconds);
        dt_ns[i] = static_cast<std::int32_t>(std::lround(seconds / kNanosecond));
    }
    return true;
}

}  // namespace d2lio
