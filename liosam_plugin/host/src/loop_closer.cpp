// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "loop_closer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "d2lio/geometry/plane.hpp"

namespace d2lio::liosam {
namespace {

constexpr std::size_t kMinTarget = 1000, kMinSource = 300;  ///< points, LIO-SAM's
constexpr double kKernel = 0.5;                             ///< m: drift may be large
constexpr double kNoInformation = 1e6;                      ///< rad^2 and m^2

MatchOptions alignment() {
    MatchOptions o;
    o.max_iterations = 100;
    o.eigenvalue_threshold = 0.0;
    o.kernel_scale = kKernel;
    o.min_spread_ratio = PlaneFitOptions{}.min_spread_ratio;
    return o;
}

}  // namespace

LoopCloser::LoopCloser(const LoopOptions& options, int threads)
    : options_(options),
      matcher_(adapter_, alignment(), threads),
      grid_(static_cast<float>(options.leaf)) {
    adapter_.set("rejection.mode", "none");  // the farthest neighbour may be metres away
}

std::optional<std::size_t> LoopCloser::candidate(const KeyframeMap& map) const {
    const Keyframe& newest = map.back();
    std::optional<std::size_t> best;
    double best_distance = options_.search_radius;
    for (std::size_t i = 0; i + 1 < map.size(); ++i) {
        const Keyframe& k = map[i];
        if (!k.has_clouds || seconds_between(newest.stamp, k.stamp) <= options_.min_time) continue;
        const double distance = (k.pose.t - newest.pose.t).norm();
        if (!(distance < best_distance)) continue;
        best = i;
        best_distance = distance;
    }
    return best;
}

/// The cloud around keyframe `centre`, in its frame: coordinates stay small.
void LoopCloser::build_target(const KeyframeMap& map, std::size_t centre) {
    const auto span = static_cast<std::size_t>(options_.neighbours);
    const std::size_t begin = centre > span ? centre - span : 0;
    const std::size_t end = std::min(map.size() - 1, centre + span + 1);
    const Pose to_centre = map[centre].pose.inverse();
    gathered_.clear();
    for (std::size_t i = begin; i < end; ++i) {
        const Pose T = to_centre * map[i].pose;
        for (const auto* cloud : {&map[i].corners, &map[i].surfaces}) {
            for (const Eigen::Vector3f& p : *cloud) {
                gathered_.push_back((T * p.cast<double>()).cast<float>());
            }
        }
    }
    grid_.filter(gathered_, thinned_);
    target_.build(thinned_);
}

double LoopCloser::fitness(const std::vector<Eigen::Vector3f>& points, const Pose& T) const {
    double sum = 0.0;
    for (const Eigen::Vector3f& p : points) {
        Neighbours near;
        target_.knn((T * p.cast<double>()).cast<float>(), 1, std::numeric_limits<float>::infinity(),
                    near);
        if (near.count < 1) return std::numeric_limits<double>::infinity();
        sum += static_cast<double>(near[0].sq_dist);
    }
    return sum / static_cast<double>(points.size());
}

std::optional<Loop> LoopCloser::find(const KeyframeMap& map) {
    if (!options_.enabled || map.size() < 2 || !map.back().has_clouds) return std::nullopt;
    const Stamp now = map.back().stamp;
    if (last_attempt_ && seconds_between(now, *last_attempt_) < options_.interval) {
        return std::nullopt;
    }
    last_attempt_ = now;
    const std::optional<std::size_t> old = candidate(map);
    if (!old) return std::nullopt;
    build_target(map, *old);
    std::vector<Eigen::Vector3f> source = map.back().surfaces;
    source.insert(source.end(), map.back().corners.begin(), map.back().corners.end());
    if (target_.size() < kMinTarget || source.size() < kMinSource) return std::nullopt;

    Pose T = map[*old].pose.inverse() * map.back().pose;
    const Mat6 P = kNoInformation * Mat6::Identity();
    const PoseView guess{T.R.data(), T.t.data()};
    adapter_.begin_scan({guess, guess, P.data(), 0, source.size()});
    const MatchReport report = matcher_.align({{}, source, no_corners_, target_}, T);
    adapter_.end_scan({T.R.data(), T.t.data()}, report.converged);
    if (report.status != MatchStatus::kOk || !report.converged) return std::nullopt;
    const double score = fitness(source, T);
    if (!(score <= options_.max_fitness)) return std::nullopt;
    return Loop{*old, map.size() - 1, T, score};
}

}  // namespace d2lio::liosam
