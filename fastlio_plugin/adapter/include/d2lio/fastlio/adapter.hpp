// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "d2lio/plugin/plugin.hpp"

/// The only surface a FAST-LIO2 host or a patched upstream touches. C++14, plain pointers only: the
/// two sides may be built with different standards and Eigen alignments. Matrices are column-major,
/// rotations 3x3 R_map_imu, lengths in m, angles in rad.
///
/// Per scan: begin_scan; in each iteration accept for every point (any thread, any order), then
/// condition on the stacked rows; end_scan. Nothing throws or exits but for lack of memory.
namespace d2lio {
namespace fastlio {

struct ScanInput {
    PoseView previous;         ///< posterior of the last scan
    PoseView predicted;        ///< prediction for this one
    const double* covariance;  ///< of the prediction, size x size
    int covariance_size;       ///< FAST-LIO2: 23
    int position_index;        ///< first row of the position block; FAST-LIO2: 0
    int rotation_index;        ///< first row of the rotation block (right tangent); FAST-LIO2: 3
    std::size_t points;        ///< scan points to be offered
    bool at_rest = false;      ///< the host holds the pose: rows are only looked at
};

struct Candidate {
    std::size_t index;           ///< of the point in its scan
    bool fresh;                  ///< neighbours come from a new search
    double imu_range;            ///< distance of the point from the IMU
    double lidar_range;          ///< distance of the point from the LiDAR
    const float* p_map;          ///< the point under the current pose, map frame
    const float* neighbours;     ///< nearest map points, ascending by distance
    const float* sq_distances;   ///< their squared distances
    std::size_t neighbour_step;  ///< floats from one neighbour to the next
    std::size_t distance_step;   ///< floats from one squared distance to the next
    int neighbour_count;
};

struct Correspondence {
    /// Of the fitted plane, map frame, unit length; with method noise_aware from the second
    /// iteration on without what noise may have put into it.
    float normal[3];
    float residual;  ///< signed point-to-plane distance
};

/// Stacked rows of the accepted correspondences: entry (r, c) lies at jacobian[r * row_step + c *
/// column_step]. Columns position..position + 2 and rotation..rotation + 2 hold the pose blocks.
struct Rows {
    double* jacobian;
    double* residual;  ///< the negative distances that accept() gave
    int count;
    std::ptrdiff_t row_step, column_step;
    int position_column, rotation_column;
    int extrinsic_column = -1;  ///< first of the six of T_imu_lidar, -1 if the host has none
};

/// Rows to append to the host's: at most 6. Columns 0-2 position, 3-5 rotation.
struct PriorBlock {
    double jacobian[6][6];
    double residual[6];
    int count;
};

class Adapter : public Plugin {
  public:
    Adapter();
    ~Adapter();

    Status begin_scan(const ScanInput& input);
    /// Decides on one point; on kAccepted fills `out`. A rejected point stays out until `fresh`.
    Verdict accept(const Candidate& candidate, Correspondence* out);
    /// Analyses the rows, projects them and corrects their residuals where the method asks for it,
    /// and returns the rows to append.
    /// @param variance of the rows' measurements (FAST-LIO2: 0.001 m^2).
    Status condition(const Rows& rows, const PoseView& pose, double variance, PriorBlock* prior);
    /// @param covariance posterior, corrected in place so that it does not claim the prior's
    /// information (degeneracy.inflate_only); may be null.
    Status end_scan(const PoseView& posterior, bool converged, double* covariance, int size);
    /// Plugin::scan_error(); none while a filter that did not begin at rest learns its velocity.
    ScanError scan_error(double misfit) const;
    /// Plugin::reset(), and what was learnt of the surfaces.
    void reset();

    /// What became of the last scan's points, in their order.
    std::size_t verdict_count() const;
    Verdict verdict(std::size_t i) const;  ///< kFewNeighbours past the end

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace fastlio
}  // namespace d2lio
