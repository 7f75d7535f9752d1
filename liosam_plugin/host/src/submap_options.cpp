// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "submap_options.hpp"

#include <cmath>
#include <string>

#include "d2lio/config/params.hpp"

namespace d2lio::liosam {

namespace {

void require(bool ok, const std::string& key, double value, const std::string& allowed) {
    if (!ok) throw ConfigError("submap." + key, std::to_string(value), allowed);
}

void require_between(double low, double high, const std::string& key, double value,
                     const std::string& allowed) {
    require(value >= low && value <= high, key, value, allowed);
}

void require_amount(const std::string& key, double value, const std::string& unit) {
    require(std::isfinite(value) && value >= 0.0, key, value, ">= 0 " + unit);
}

}  // namespace

void validate(const SubmapOptions& o) {
    constexpr double kLeast = 0.01 * (1.0 - 1e-6), kMost = 100.0;  // 0.01 as float is below 0.01
    require_between(1.0, 3000.0, "search_radius", o.search_radius, "[1, 3000] m");
    require_between(0.1, 1000.0, "density", o.density, "[0.1, 1000] m");
    require_between(kLeast, kMost, "corner_leaf", static_cast<double>(o.corner_leaf),
                    "[0.01, 100] m");
    require_between(kLeast, kMost, "surface_leaf", static_cast<double>(o.surface_leaf),
                    "[0.01, 100] m");
    require_amount("recent_s", o.recent_s, "s");
    require_amount("keyframe_distance", o.keyframe_distance, "m");
    require_amount("keyframe_angle", o.keyframe_angle, "rad");
    require_amount("keyframe_interval_s", o.keyframe_interval_s, "s");
    require(o.max_clouds >= 1, "max_clouds", static_cast<double>(o.max_clouds), ">= 1");
}

}  // namespace d2lio::liosam
