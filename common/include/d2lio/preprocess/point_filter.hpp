// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

struct PointFilterOptions {
    double blind = 0.5;  ///< returns at or below this range are dropped, m, >= 0
    double max_range = std::numeric_limits<double>::infinity();  ///< m, > blind
    int stride = 1;  ///< keeps every n-th point of the message, >= 1 (`point_filter_num`)
};

/// How many points were dropped, by the first reason that applied, in this order.
struct FilterCounts {
    std::size_t offered = 0;
    std::size_t stride = 0;      ///< skipped by down-sampling, not looked at
    std::size_t not_finite = 0;  ///< NaN or Inf coordinate
    std::size_t zero = 0;        ///< (0, 0, 0): no return
    std::size_t bad_time = 0;    ///< negative offset: unusable point time
    std::size_t too_near = 0;    ///< within `blind`
    std::size_t too_far = 0;     ///< beyond `max_range`
    std::size_t kept = 0;

    FilterCounts& operator+=(const FilterCounts& other);
};

/// Drops returns that carry no geometry. Order is kept; nothing is allocated in the steady state.
class PointFilter {
  public:
    /// @throws ConfigError for a value outside its range, with `key_prefix` before its name.
    explicit PointFilter(const PointFilterOptions& options = {},
                         const std::string& key_prefix = "lidar.");

    const PointFilterOptions& options() const { return options_; }
    /// Compacts in place and returns this call's counts.
    FilterCounts apply(std::vector<LidarPoint>& points) const;
    /// Writes the kept points to `out` (replaced; its capacity is reused).
    FilterCounts apply(const std::vector<LidarPoint>& in, std::vector<LidarPoint>& out) const;

  private:
    bool keep(const LidarPoint& point, FilterCounts& counts) const;

    PointFilterOptions options_;
    double min_sq_ = 0.0, max_sq_ = 0.0;
};

struct RingLoss {
    int present = 0;  ///< rings with a return in the whole scan
    int lost = 0;     ///< of these, rings no point of which survives the stride
};

/// Rings that a stride removes altogether: in column-ordered clouds a stride that divides the
/// number of rings keeps the same few rings in every column, and with them little of the scene.
RingLoss rings_lost(const std::vector<LidarPoint>& points, int stride);

}  // namespace d2lio
