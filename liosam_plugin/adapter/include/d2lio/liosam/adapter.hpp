// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "d2lio/plugin/plugin.hpp"
#include "d2lio/plugin/row_view.hpp"

/// The only surface a LIO-SAM host or a patched upstream touches. C++14, plain pointers only: the
/// two sides may be built with different standards and Eigen alignments. Lengths in m, angles in
/// rad. "Body" is the frame whose pose is estimated: the IMU here, upstream's lidar_link there.
///
/// Per scan: begin_scan; in each iteration gate() and, where a line or plane fits, weigh() for
/// every feature (any thread, any order), then condition() on the normal equations; end_scan.
/// Nothing throws or exits but for lack of memory.
namespace d2lio {
namespace liosam {

/// Pose variables of LIO-SAM's scan matching: roll, pitch, yaw, x, y, z with
/// R_map_body = Rz(yaw) Ry(pitch) Rx(roll); increments are additive.
constexpr int kPoseSize = 6;

enum class Feature : std::uint8_t { kCorner, kSurface };

struct ScanInput {
    PoseView previous;         ///< estimate of the last scan
    PoseView predicted;        ///< initial guess for this one
    const double* covariance;  ///< of the guess relative to the last matched pose, 6 x 6
                               ///< column-major: rotation (right tangent, body), position (map)
    std::size_t corners, surfaces;  ///< features to be offered
};

struct Candidate {
    Feature feature;
    std::size_t index;          ///< of the feature in its cloud
    double range;               ///< distance of the point from the body's origin
    const float* sq_distances;  ///< to the nearest map points, ascending
    std::size_t distance_step;  ///< floats from one to the next
    int neighbour_count;
};

/// A^T A and A^T b of one iteration; the step d solves A^T A d = A^T b, b = minus the residuals.
struct NormalEquations {
    double* AtA;  ///< 6 x 6, symmetric
    double* Atb;  ///< 6
    /// The rows themselves, for condition_tangent() with a method that counts them; null: none.
    const RowView* rows = nullptr;
};

class Adapter : public Plugin {
  public:
    Adapter();
    ~Adapter();

    Status begin_scan(const ScanInput& input);
    /// Decides on a feature after the search, before any fit.
    /// @returns what to use in place of the squared distance to the 5th neighbour: the distance
    /// itself where the host's own gate decides, 0 to accept, infinity to reject.
    float gate(const Candidate& candidate);
    /// Decides on a feature whose line or plane fits.
    /// @param weight the host's s, accepted above 0.1. @returns the weight to use, 0 to reject.
    double weigh(Feature feature, std::size_t index, double weight);
    /// The host's fit failed for good: neighbours on a line, or not finite.
    void mark_singular(Feature feature, std::size_t index);

    /// Analyses the normal equations in LIO-SAM's variables and adds the prior, or holds the
    /// directions that the method asks to hold.
    /// @param pose current iterate, 6 numbers; @param variance of the rows' measurements, m^2 (rows
    /// have unit weight, so a prior of information W enters as variance * W).
    Status condition(const double* pose, double variance, const NormalEquations& equations);
    /// The same with steps in the right tangent of the body (first three) and in map axes.
    Status condition_tangent(const PoseView& pose, double variance,
                             const NormalEquations& equations);
    /// What to multiply the solved step by, once an iteration: 1, or less after a scan has begun to
    /// step back and forth. Always 1 where the host's own gates decide.
    /// @param step 6 numbers; @param AtA 6 x 6 of the same variables, with or without the prior.
    double step_factor(const double* step, const double* AtA);
    /// Whether some direction of the last conditioned equations is weak, judged on the scan's own
    /// rows, before any prior.
    bool degenerate() const;
    Status end_scan(const PoseView& estimate, bool converged);

    /// What became of the last scan's points: corners, then surfaces, in their order.
    std::size_t verdict_count() const;
    Verdict verdict(std::size_t i) const;  ///< kFewNeighbours past the end

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// R_map_body of a pose's roll, pitch, yaw, 3 x 3 column-major.
void rotation_from_rpy(const double* rpy, double* R);
/// d(right tangent)/d(roll, pitch, yaw), 3 x 3 column-major: body rates of Euler rates.
void euler_jacobian(double roll, double pitch, double* E);

}  // namespace liosam
}  // namespace d2lio
