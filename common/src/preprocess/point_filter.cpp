// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/point_filter.hpp"

#include <cmath>

#include "d2lio/config/params.hpp"

namespace d2lio {
namespace {

bool is_zero(const LidarPoint& p) { return p.x == 0.F && p.y == 0.F && p.z == 0.F; }

bool is_finite(const LidarPoint& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

}  // namespace

FilterCounts& FilterCounts::operator+=(const FilterCounts& other) {
    offered += other.offered;
    stride += other.stride;
    not_finite += other.not_finite;
    zero += other.zero;
    bad_time += other.bad_time;
    too_near += other.too_near;
    too_far += other.too_far;
    kept += other.kept;
    return *this;
}

PointFilter::PointFilter(const PointFilterOptions& options, const std::string& key_prefix)
    : options_(options),
      min_sq_(options.blind * options.blind),
      max_sq_(options.max_range * options.max_range) {
    if (!(std::isfinite(options.blind) && options.blind >= 0.0)) {
        throw ConfigError(key_prefix + "blind", std::to_string(options.blind), ">= 0 m, finite");
    }
    if (!(options.max_range > options.blind)) {
        throw ConfigError(key_prefix + "max_range", std::to_string(options.max_range),
                          "> " + key_prefix + "blind = " + std::to_string(options.blind) + " m");
    }
    if (options.stride < 1) {
        throw ConfigError(key_prefix + "stride", std::to_string(options.stride), ">= 1");
    }
}

bool PointFilter::keep(const LidarPoint& point, FilterCounts& counts) const {
    if (!is_finite(point)) {
        ++counts.not_finite;
    } else if (is_zero(point)) {
        ++counts.zero;
    } else if (point.dt_ns < 0) {
        ++counts.bad_time;
    } else {
        const double sq = point.xyz().cast<double>().squaredNorm();
        if (sq > min_sq_ && sq <= max_sq_) return true;
        ++(sq > max_sq_ ? counts.too_far : counts.too_near);
    }
    return false;
}

FilterCounts PointFilter::apply(std::vector<LidarPoint>& points) const {
    FilterCounts counts;
    counts.offered = points.size();
    const auto stride = static_cast<std::size_t>(options_.stride);
    for (std::size_t i = 0; i < points.size(); i += stride) {
        if (keep(points[i], counts)) points[counts.kept++] = points[i];
    }
    counts.stride = counts.offered - (counts.offered + stride - 1) / stride;
    points.resize(counts.kept);
    return counts;
}

FilterCounts PointFilter::apply(const std::vector<LidarPoint>& in,
                                std::vector<LidarPoint>& out) const {
    FilterCounts counts;
    counts.offered = in.size();
    const auto stride = static_cast<std::size_t>(options_.stride);
    out.clear();
    for (std::size_t i = 0; i < in.size(); i += stride) {
        if (keep(in[i], counts)) out.push_back(in[i]);
    }
    counts.kept = out.size();
    counts.stride = counts.offered - (counts.offered + stride - 1) / stride;
    return counts;
}

RingLoss rings_lost(const std::vector<LidarPoint>& points, int stride) {
    enum : unsigned char { kUnseen, kLost, kKept };
    std::vector<unsigned char> rings;
    const auto step = static_cast<std::size_t>(stride < 1 ? 1 : stride);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const LidarPoint& point = points[i];
        if (!is_finite(point) || is_zero(point)) continue;
        if (point.ring >= rings.size()) rings.resize(std::size_t{point.ring} + 1, kUnseen);
        if (i % step == 0) {
            rings[point.ring] = kKept;
        } else if (rings[point.ring] == kUnseen) {
            rings[point.ring] = kLost;
        }
    }
    RingLoss loss;
    for (const unsigned char state : rings) {
        loss.present += state != kUnseen;
        loss.lost += state == kLost;
    }
    return loss;
}

}  // namespace d2lio
