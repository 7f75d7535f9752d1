// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/rejection/rejector.hpp"

#include <cmath>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {

MotionMagnitude MotionMagnitude::of(const Pose& motion) {
    return {motion.t.norm(), log_so3(motion.R).norm()};
}

double MotionMagnitude::displacement(double range) const {
    return translation + 2.0 * range * std::sin(0.5 * rotation);
}

double KissRejection::sigma() const {
    return std::sqrt((sigma_0 * sigma_0 + sum_of_squares) / (1 + samples));
}

void KissRejection::end_scan(const MotionMagnitude& deviation) {
    const double delta = deviation.displacement(r_max);
    if (delta > delta_min) {
        sum_of_squares += delta * delta;
        ++samples;
    }
}

void RejectionConfig::bind(ParamTable& table) {
    table.add("rejection.mode", mode, {"off", "none", "fixed", "kiss", "point_adaptive"},
              "strategy; off leaves the host's own gates alone");
    table.add("rejection.keep_host_gate", keep_host_gate,
              "keep all gates of the host, and no others, on top of the strategy");
    table.add("rejection.tau", tau, {0.0, 1e6}, "m", "threshold of mode fixed");
    table.add("rejection.sigma_0", sigma_0, {1e-6, 1e6}, "m", "first sigma of mode kiss");
    table.add("rejection.delta_min", delta_min, {0.0, 1e6}, "m",
              "smaller deviations do not enter sigma (mode kiss)");
    table.add("rejection.r_max", r_max, {0.0, 1e6}, "m",
              "range at which rotation counts (mode kiss)");
    table.add("rejection.epsilon_0", epsilon_0, {0.0, 1e6}, "m",
              "floor of mode point_adaptive; auto is the map's voxel size, 0 the literal paper");
    table.add("rejection.motion", motion, {"predicted", "deviation"},
              "motion that opens the threshold of mode point_adaptive");
}

void RejectionConfig::validate() const {
    using Motion = PointAdaptiveRejection::Motion;
    if (mode == RejectionMode::kPointAdaptive && motion == Motion::kDeviation && epsilon_0 == 0.0) {
        // Nothing accepted means no deviation, which means nothing accepted.
        throw ConfigError("rejection.epsilon_0", "0", "> 0 with rejection.motion deviation");
    }
}

Rejector::Rejector(const RejectionConfig& config, double map_voxel)
    : active_(config.mode != RejectionMode::kOff),
      host_gates_(config.mode == RejectionMode::kOff || config.keep_host_gate) {
    switch (config.mode) {
        case RejectionMode::kOff:
        case RejectionMode::kNone:
            policy_ = NoRejection{};
            break;
        case RejectionMode::kFixed:
            policy_ = FixedRejection{config.tau};
            break;
        case RejectionMode::kKiss:
            policy_ = KissRejection{config.sigma_0, config.delta_min, config.r_max};
            break;
        case RejectionMode::kPointAdaptive:
            policy_ =
                PointAdaptiveRejection{config.epsilon_0.value_or(map_voxel), config.motion, {}};
            break;
    }
}

double Rejector::threshold(double range) const {
    return std::visit([range](const auto& p) { return p.threshold(range); }, policy_);
}

double Rejector::sigma() const {
    const auto* kiss = std::get_if<KissRejection>(&policy_);
    return kiss != nullptr ? kiss->sigma() : std::numeric_limits<double>::quiet_NaN();
}

void Rejector::begin_scan(const Pose& motion) {
    const auto m = MotionMagnitude::of(motion);
    std::visit([&m](auto& p) { p.begin_scan(m); }, policy_);
}

void Rejector::end_scan(const Pose& deviation) {
    const auto m = MotionMagnitude::of(deviation);
    std::visit([&m](auto& p) { p.end_scan(m); }, policy_);
}

}  // namespace d2lio
