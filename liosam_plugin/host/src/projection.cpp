// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "projection.hpp"

#include <algorithm>
#include <cmath>

#include "d2lio/config/params.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kMostRings = 1024;
constexpr int kMostColumns = 32768;
constexpr std::int32_t kNoPoint = -1;
constexpr double kTurn = 6.283185307179586476925;  // rad

void check_count(const std::string& key, int value, int most) {
    if (value >= 1 && value <= most) return;
    throw ConfigError(key, std::to_string(value), "1 to " + std::to_string(most));
}

void check(const ProjectionOptions& options, const std::string& prefix) {
    check_count(prefix + "rings", options.rings, kMostRings);
    check_count(prefix + "columns", options.columns, kMostColumns);
    check_count(prefix + "ring_step", options.ring_step, options.rings);
    if (!(options.min_range >= 0.0 && std::isfinite(options.min_range))) {
        throw ConfigError(prefix + "min_range", std::to_string(options.min_range),
                          ">= 0 m, finite");
    }
    if (!(options.max_range > options.min_range && std::isfinite(options.max_range))) {
        throw ConfigError(
            prefix + "max_range", std::to_string(options.max_range),
            "> " + prefix + "min_range = " + std::to_string(options.min_range) + " m, finite");
    }
}

float range_of(const LidarPoint& p) { return std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z); }

bool is_finite(const LidarPoint& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

}  // namespace

int azimuth_column(float x, float y, int columns) {
    const double turns = static_cast<double>(std::atan2(y, x)) / kTurn;  // -0.5 to 0.5
    const int column = static_cast<int>(std::floor(turns * columns + 0.5)) + columns / 2;
    if (column < 0) return column + columns;  // straight back, odd number of columns
    return column < columns ? column : column - columns;
}

Projection::Projection(const ProjectionOptions& options, const std::string& key_prefix)
    : options_(options) {
    check(options, key_prefix);
    const auto rings = static_cast<std::size_t>(options.rings);
    cells_.resize(rings * static_cast<std::size_t>(options.columns));
    in_order_.resize(rings);
}

ProjectionCounts Projection::project(const std::vector<LidarPoint>& raw,
                                     const std::vector<LidarPoint>& deskewed, OrderedScan& out) {
    std::fill(cells_.begin(), cells_.end(), Cell{kNoPoint, 0.0F});
    std::fill(in_order_.begin(), in_order_.end(), 0);
    ProjectionCounts counts;
    counts.offered = std::max(raw.size(), deskewed.size());
    const std::size_t pairs = std::min(raw.size(), deskewed.size());
    counts.unpaired = counts.offered - pairs;
    for (std::size_t i = 0; i < pairs; ++i) {
        const float range = range_of(raw[i]);
        if (usable(raw[i], deskewed[i], range, counts)) place(raw[i], i, range, counts);
    }
    read_out(deskewed, counts.kept, out);
    return counts;
}

bool Projection::usable(const LidarPoint& raw, const LidarPoint& deskewed, float range,
                        ProjectionCounts& counts) const {
    if (!is_finite(raw) || !is_finite(deskewed)) {
        ++counts.not_finite;
    } else if (range < options_.min_range || range == 0.0F) {
        ++counts.too_near;
    } else if (range > options_.max_range) {
        ++counts.too_far;
    } else if (raw.ring >= options_.rings) {
        ++counts.no_ring;
    } else if (raw.ring % options_.ring_step != 0) {
        ++counts.ring_step;
    } else {
        return true;
    }
    return false;
}

void Projection::place(const LidarPoint& raw, std::size_t index, float range,
                       ProjectionCounts& counts) {
    const std::size_t row = raw.ring;
    const int column = options_.column_by_order ? std::min(in_order_[row]++, options_.columns)
                                                : azimuth_column(raw.x, raw.y, options_.columns);
    if (column == options_.columns) {
        ++counts.no_column;
        return;
    }
    Cell& cell =
        cells_[row * static_cast<std::size_t>(options_.columns) + static_cast<std::size_t>(column)];
    if (cell.index != kNoPoint) {
        ++counts.duplicate;
        return;
    }
    cell = {static_cast<std::int32_t>(index), range};
    ++counts.kept;
}

void Projection::read_out(const std::vector<LidarPoint>& deskewed, std::size_t kept,
                          OrderedScan& out) {
    out.points.resize(kept);
    out.ranges.resize(kept);
    out.columns.resize(kept);
    out.ring_begin.clear();
    out.ring_end.clear();
    std::size_t next = 0;
    const Cell* cell = cells_.data();
    for (int row = 0; row < options_.rings; ++row) {
        out.ring_begin.push_back(static_cast<std::int32_t>(next) + kRingMargin);
        for (std::int32_t column = 0; column < options_.columns; ++column, ++cell) {
            if (cell->index == kNoPoint) continue;
            out.points[next] = deskewed[static_cast<std::size_t>(cell->index)].xyz();
            out.ranges[next] = cell->range;
            out.columns[next] = column;
            ++next;
        }
        out.ring_end.push_back(static_cast<std::int32_t>(next) - 1 - kRingMargin);
    }
}

}  // namespace d2lio::liosam
