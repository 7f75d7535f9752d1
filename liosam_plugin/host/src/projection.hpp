// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio::liosam {

/// Points on either side of a point that its curvature needs; so many at each end of a ring can be
/// no features.
constexpr int kRingMargin = 5;

struct ProjectionOptions {
    int rings = 16;                ///< rows of the range image, 1 to 1024
    int columns = 1800;            ///< columns of the range image, 1 to 32768
    int ring_step = 1;             ///< keeps rings whose index it divides, 1 to `rings`
    double min_range = 1.0;        ///< m, >= 0
    double max_range = 1000.0;     ///< m, > min_range, finite
    bool column_by_order = false;  ///< columns count up per ring instead of by azimuth (Livox)
};

/// A scan as rows of a range image one after the other, columns rising within each row; what
/// LIO-SAM calls cloud_info. All per-point vectors have one entry per point.
struct OrderedScan {
    std::vector<Eigen::Vector3f> points;  ///< de-skewed, LiDAR frame, m
    std::vector<float> ranges;            ///< as measured, m
    std::vector<std::int32_t> columns;    ///< in the range image
    /// First and last point of every ring that has kRingMargin neighbours of the same ring on both
    /// sides; begin > end where a ring has none.
    std::vector<std::int32_t> ring_begin, ring_end;
};

/// How many points were dropped, by the first reason that applied, in this order.
struct ProjectionCounts {
    std::size_t offered = 0;
    std::size_t unpaired = 0;    ///< without a partner: the two clouds differ in length
    std::size_t not_finite = 0;  ///< NaN or Inf, as measured or de-skewed
    std::size_t too_near = 0;    ///< below `min_range`, or no return at (0, 0, 0)
    std::size_t too_far = 0;     ///< beyond `max_range`
    std::size_t no_ring = 0;     ///< ring index not below `rings`
    std::size_t ring_step = 0;   ///< ring left out by `ring_step`
    std::size_t no_column = 0;   ///< by order only: more points in the ring than columns
    std::size_t duplicate = 0;   ///< cell taken by an earlier point
    std::size_t kept = 0;
};

/// Column of a direction in a range image (LIO-SAM's convention): column 0 looks backwards (-x),
/// columns rise counter-clockwise, columns / 2 looks ahead (+x).
/// @param x,y in the LiDAR frame, m, finite
/// @return 0 to columns - 1
int azimuth_column(float x, float y, int columns);

/// Sorts a scan into a range image (LOAM, section V-A; LIO-SAM's imageProjection). The first point
/// of a cell wins. Reuses its buffers: in steady state it allocates nothing.
class Projection {
  public:
    /// @throws ConfigError for a value outside its range, with `key_prefix` before its name.
    explicit Projection(const ProjectionOptions& options, const std::string& key_prefix = "lidar.");

    const ProjectionOptions& options() const { return options_; }
    /// @param raw as measured: gives cell and range; @param deskewed the same points in the same
    /// order: gives the coordinates (may be the same object). Replaces `out`.
    ProjectionCounts project(const std::vector<LidarPoint>& raw,
                             const std::vector<LidarPoint>& deskewed, OrderedScan& out);

  private:
    struct Cell {
        std::int32_t index;  ///< of the point, kNoPoint in an empty cell
        float range;         ///< m
    };

    bool usable(const LidarPoint& raw, const LidarPoint& deskewed, float range,
                ProjectionCounts& counts) const;
    void place(const LidarPoint& raw, std::size_t index, float range, ProjectionCounts& counts);
    void read_out(const std::vector<LidarPoint>& deskewed, std::size_t kept, OrderedScan& out);

    ProjectionOptions options_;
    std::vector<Cell> cells_;             ///< row by row
    std::vector<std::int32_t> in_order_;  ///< next column per ring, by order only
};

}  // namespace d2lio::liosam
