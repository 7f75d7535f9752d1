// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "d2lio/preprocess/voxel_grid.hpp"
#include "keyframe_map.hpp"
#include "scan_to_map.hpp"

namespace d2lio::liosam {

/// Defaults are LIO-SAM's, but for `enabled`: odometry is compared without loops.
struct LoopOptions {
    bool enabled = false;
    double interval = 1.0;        ///< s between two attempts
    double search_radius = 15.0;  ///< m, around the newest keyframe
    double min_time = 30.0;       ///< s, a candidate is at least so much older
    int neighbours = 25;          ///< keyframes on either side of the candidate
    double max_fitness = 0.3;     ///< m^2, mean squared distance to the nearest point
    double leaf = 0.4;            ///< m, voxel of the candidate's cloud
};

/// A keyframe seen again: T_from_to maps points of `to` (the newest) to `from`.
struct Loop {
    std::size_t from, to;
    Pose T_from_to;
    double fitness;  ///< m^2
};

/// Looks for places seen before (LIO-SAM, section III-E): the nearest keyframe that is old enough,
/// confirmed by aligning the newest keyframe with the cloud around it.
class LoopCloser {
  public:
    LoopCloser(const LoopOptions& options, int threads);

    /// The loop that the newest keyframe closes, if any. Nothing while disabled.
    std::optional<Loop> find(const KeyframeMap& map);
    void reset() { last_attempt_.reset(); }

  private:
    std::optional<std::size_t> candidate(const KeyframeMap& map) const;
    void build_target(const KeyframeMap& map, std::size_t centre);
    double fitness(const std::vector<Eigen::Vector3f>& points, const Pose& T) const;

    LoopOptions options_;
    Adapter adapter_;
    ScanToMap matcher_;
    VoxelGrid grid_;
    std::optional<Stamp> last_attempt_;
    std::vector<Eigen::Vector3f> gathered_, thinned_;
    IkdTree target_, no_corners_;
};

}  // namespace d2lio::liosam
