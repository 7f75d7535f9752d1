// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>

#include "d2lio/types.hpp"
#include "graph_status.hpp"

namespace d2lio::liosam {

/// Variances of the factors; the defaults are LIO-SAM's.
struct KeyframeGraphOptions {
    double odometry_rotation_variance = 1e-6;     ///< rad^2, > 0
    double odometry_translation_variance = 1e-4;  ///< m^2, > 0
    double prior_tilt_variance = 1e-2;            ///< rad^2, > 0; roll and pitch of the first pose
    double prior_yaw_variance = 9.8696044;        ///< rad^2, > 0; pi^2: unknown
    double prior_position_variance = 1e8;         ///< m^2, > 0
    int max_keyframes = 5000;  ///< poses that can still move, [2, 20000]; older ones are frozen

    /// @throws ConfigError with key, value and allowed range
    void validate() const;
};

/// What happened since construction.
struct KeyframeGraphCounts {
    std::size_t loops = 0;              ///< loop factors taken in
    std::size_t rejected = 0;           ///< inputs refused
    std::size_t solver_failures = 0;    ///< the solver threw or gave NaN: started anew
    std::size_t restarts = 0;           ///< the graph was full: older poses were frozen
    std::size_t last_reeliminated = 0;  ///< variables the last change made iSAM2 solve again
};

/// LIO-SAM's keyframe graph (Shan et al. 2020, sec. III-C and III-D): iSAM2 over poses with
/// odometry factors between neighbours and loop factors. A chain without loops has its poses as
/// they were given; only a loop moves them. Not thread safe; equal inputs give equal bits.
class KeyframeGraph {
  public:
    /// @throws ConfigError
    explicit KeyframeGraph(const KeyframeGraphOptions& options = {});
    ~KeyframeGraph();
    KeyframeGraph(KeyframeGraph&&) noexcept;
    KeyframeGraph& operator=(KeyframeGraph&&) noexcept;

    /// Appends a keyframe at T_map_imu `pose`, tied to the last one by their present difference.
    /// @return kRejected: not finite or not rigid, nothing appended. kRecovered: appended, but the
    ///         solver failed and all older poses are frozen.
    GraphStatus add(const Pose& pose);

    /// Ties two keyframes by a measured T_from_to (maps points of `to` to `from`) and solves. A
    /// frozen keyframe acts as a fixed point.
    /// @param variance of each of the six error terms, rad^2 and m^2, in [1e-12, 1e12]
    /// @return kRejected: no such keyframes, both frozen, one and the same, or not finite;
    ///         kRecovered: the solver failed, the poses are as before and frozen but for the newest
    GraphStatus add_loop(std::size_t from, std::size_t to, const Pose& T_from_to, double variance);

    /// T_map_imu of keyframe `i`. @throws std::out_of_range
    const Pose& pose(std::size_t i) const;
    std::size_t size() const;
    /// Keyframes below this index are frozen.
    std::size_t first_active() const;
    /// Whether a loop has moved earlier poses since the last call.
    bool moved();
    /// 6x6 of the newest keyframe's error: rotation (right, body axes, rad^2), position (map, m^2).
    /// Zero without keyframes. Absolute, hence dominated by the first pose's prior.
    Mat6 covariance() const;
    /// Forgets all keyframes; counts stay.
    void clear();
    const KeyframeGraphCounts& counts() const;

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace d2lio::liosam
