// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "features.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "d2lio/config/params.hpp"

namespace d2lio::liosam {
namespace {

constexpr std::size_t kMargin = kRingMargin;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

void check_positive(const std::string& key, float value) {
    if (value > 0.0F && std::isfinite(value)) return;
    throw ConfigError(key, std::to_string(value), "> 0, finite");
}

void check_count(const std::string& key, int value, int least, int most) {
    if (value >= least && value <= most) return;
    throw ConfigError(key, std::to_string(value),
                      std::to_string(least) + " to " + std::to_string(most));
}

const FeatureOptions& checked(const FeatureOptions& options, const std::string& prefix) {
    constexpr int kMostSectors = 1000, kMany = 1000000;
    check_positive(prefix + "edge_threshold", options.edge_threshold);
    check_positive(prefix + "surface_threshold", options.surface_threshold);
    check_positive(prefix + "surface_leaf", options.surface_leaf);
    check_positive(prefix + "occlusion_step", options.occlusion_step);
    check_positive(prefix + "parallel_ratio", options.parallel_ratio);
    check_count(prefix + "sectors", options.sectors, 1, kMostSectors);
    check_count(prefix + "corners_per_sector", options.corners_per_sector, 0, kMany);
    check_count(prefix + "occlusion_columns", options.occlusion_columns, 1, kMany);
    check_count(prefix + "gap_columns", options.gap_columns, 1, kMany);
    return options;
}

bool consistent(const OrderedScan& scan) {
    return scan.ranges.size() == scan.points.size() && scan.columns.size() == scan.points.size() &&
           scan.ring_begin.size() == scan.ring_end.size() &&
           scan.points.size() <= std::numeric_limits<std::uint32_t>::max();
}

/// Floats from 0 up order as their bits do.
std::uint64_t ordered_bits(float not_negative) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &not_negative, sizeof bits);
    return bits;
}

/// Columns between a point and the next.
std::int64_t columns_after(const OrderedScan& scan, std::size_t i) {
    return std::abs(std::int64_t{scan.columns[i + 1]} - scan.columns[i]);
}

std::size_t index_of(std::uint64_t key) { return key & 0xFFFFFFFFU; }

}  // namespace

FeatureExtractor::FeatureExtractor(const FeatureOptions& options, const std::string& key_prefix)
    : options_(checked(options, key_prefix)), surface_grid_(options.surface_leaf) {}

void FeatureExtractor::extract(const OrderedScan& scan, Features& out) {
    out.corners.clear();
    out.surfaces.clear();
    if (!consistent(scan)) return;
    const std::size_t size = scan.points.size();
    curvature_.resize(size);
    taken_.assign(size, 0);
    corner_.assign(size, 0);
    for (std::size_t r = 0; r < scan.ring_begin.size(); ++r) {
        const std::int64_t begin = scan.ring_begin[r], last = scan.ring_end[r];
        const bool inside =
            begin >= kRingMargin && last + kRingMargin < static_cast<std::int64_t>(size);
        if (begin > last || !inside) continue;
        extract_ring(scan, {static_cast<std::size_t>(begin), static_cast<std::size_t>(last) + 1},
                     out);
    }
}

void FeatureExtractor::extract_ring(const OrderedScan& scan, Span ring, Features& out) {
    compute_curvature(scan, ring);
    mark_hidden(scan, ring);
    mark_grazing(scan, ring);
    const auto sectors = static_cast<std::size_t>(options_.sectors);
    const std::size_t last_disputed = last_disputed_sector(ring);
    for (std::size_t s = 0; s < sectors; ++s) {
        pick_corners(scan, sector(ring, s), out);
        if (s < last_disputed) pick_smooth(scan, sector(ring, s));
    }
    append_surfaces(scan, ring, out);
}

FeatureExtractor::Span FeatureExtractor::sector(Span ring, std::size_t s) const {
    const auto sectors = static_cast<std::size_t>(options_.sectors);
    const std::size_t length = ring.end - ring.begin;
    return {ring.begin + length * s / sectors, ring.begin + length * (s + 1) / sectors};
}

/// The last sector that starts with a sharp point within reach of the sector before, 0 if none.
/// From there on smooth points need not be looked for: they would keep no corner away.
std::size_t FeatureExtractor::last_disputed_sector(Span ring) const {
    for (auto s = static_cast<std::size_t>(options_.sectors) - 1; s > 0; --s) {
        const std::size_t begin = sector(ring, s).begin;
        for (std::size_t i = begin; i < std::min(begin + kMargin, ring.end); ++i) {
            if (taken_[i] == 0 && curvature_[i] > options_.edge_threshold) return s;
        }
    }
    return 0;
}

void FeatureExtractor::compute_curvature(const OrderedScan& scan, Span ring) {
    for (std::size_t i = ring.begin; i < ring.end; ++i) {
        const float* r = &scan.ranges[i];
        const float difference =
            r[-5] + r[-4] + r[-3] + r[-2] + r[-1] - 10.0F * r[0] + r[1] + r[2] + r[3] + r[4] + r[5];
        curvature_[i] = difference * difference;
    }
}

/// Where the range steps, the farther side ends at a shadow: its edge is no edge of an object and
/// moves with the sensor.
void FeatureExtractor::mark_hidden(const OrderedScan& scan, Span ring) {
    const std::size_t first = ring.begin - kMargin, last = ring.end - 1 + kMargin;
    for (std::size_t i = first; i < last; ++i) {
        const float step = scan.ranges[i + 1] - scan.ranges[i];
        if (!(std::abs(step) > options_.occlusion_step)) continue;
        if (columns_after(scan, i) >= options_.occlusion_columns) continue;
        const std::size_t from = step > 0.0F ? i + 1 : std::max(i, first + kMargin) - kMargin;
        const std::size_t to = step > 0.0F ? std::min(i + 1 + kMargin, last) : i;
        std::fill(taken_.begin() + static_cast<std::ptrdiff_t>(from),
                  taken_.begin() + static_cast<std::ptrdiff_t>(to) + 1, std::uint8_t{1});
    }
}

/// A surface nearly along the beam: its points are far apart and badly ranged.
void FeatureExtractor::mark_grazing(const OrderedScan& scan, Span ring) {
    for (std::size_t i = ring.begin; i < ring.end; ++i) {
        const float range = scan.ranges[i];
        const float least = options_.parallel_ratio * range;
        if (std::abs(scan.ranges[i - 1] - range) > least &&
            std::abs(scan.ranges[i + 1] - range) > least) {
            taken_[i] = 1;
        }
    }
}

void FeatureExtractor::sort_candidates(Span sector, float above, float below) {
    candidates_.clear();
    for (std::size_t i = sector.begin; i < sector.end; ++i) {
        const float curvature = curvature_[i];
        if (taken_[i] == 0 && curvature > above && curvature < below) {
            candidates_.push_back(ordered_bits(curvature) << 32U | i);
        }
    }
    std::sort(candidates_.begin(), candidates_.end());
}

void FeatureExtractor::pick_corners(const OrderedScan& scan, Span sector, Features& out) {
    sort_candidates(sector, options_.edge_threshold, kInfinity);
    int picked = 0;
    for (auto key = candidates_.rbegin();
         key != candidates_.rend() && picked < options_.corners_per_sector; ++key) {
        const std::size_t i = index_of(*key);
        if (taken_[i] != 0 || !scan.points[i].allFinite()) continue;
        corner_[i] = 1;
        out.corners.push_back(scan.points[i]);
        suppress_around(scan, i);
        ++picked;
    }
}

void FeatureExtractor::pick_smooth(const OrderedScan& scan, Span sector) {
    constexpr float kBelowZero = -1.0F;
    sort_candidates(sector, kBelowZero, options_.surface_threshold);
    for (const Key key : candidates_) {
        if (taken_[index_of(key)] == 0) suppress_around(scan, index_of(key));
    }
}

/// Takes a point and its neighbours to both sides as far as there is no gap.
void FeatureExtractor::suppress_around(const OrderedScan& scan, std::size_t i) {
    const auto gap = [&](std::size_t a) { return columns_after(scan, a) > options_.gap_columns; };
    taken_[i] = 1;
    for (std::size_t j = i; j < i + kMargin && !gap(j); ++j) taken_[j + 1] = 1;
    for (std::size_t j = i; j > i - kMargin && !gap(j - 1); --j) taken_[j - 1] = 1;
}

void FeatureExtractor::append_surfaces(const OrderedScan& scan, Span ring, Features& out) {
    ring_surfaces_.clear();
    for (std::size_t i = ring.begin; i < ring.end; ++i) {
        if (corner_[i] == 0) ring_surfaces_.push_back(scan.points[i]);
    }
    surface_grid_.filter(ring_surfaces_, ring_surfaces_sparse_);
    out.surfaces.insert(out.surfaces.end(), ring_surfaces_sparse_.begin(),
                        ring_surfaces_sparse_.end());
}

}  // namespace d2lio::liosam
