// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace d2lio::fastlio {

using G = GateConstants;

void Gate::begin_scan(std::size_t points) {
    verdicts_.assign(points, Verdict::kFewNeighbours);
    planes_.resize(points);
    thresholds_.assign(points, std::numeric_limits<float>::infinity());
}

Verdict Gate::fit(const Candidate& c, const Rejector& rejector) {
    if (c.neighbour_count < G::kNeighbours) return Verdict::kFewNeighbours;
    const float* sq = c.sq_distances;
    if (rejector.host_gates() && sq[(G::kNeighbours - 1) * c.distance_step] > G::kMaxSqDistance) {
        return Verdict::kFarNeighbours;
    }
    const double threshold = rejector.threshold(c.imu_range);
    thresholds_[c.index] = static_cast<float>(threshold);
    if (!(static_cast<double>(sq[0]) <= threshold * threshold)) return Verdict::kThreshold;

    PlaneFitOptions options;
    options.max_distance = G::kPlaneDistance;
    if (!rejector.active()) options.min_spread_ratio = 0.0;  // upstream has no such check
    switch (fit_plane(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, options,
                      planes_[c.index])) {
        case PlaneStatus::kSingular:
            return Verdict::kSingularPlane;
        case PlaneStatus::kRough:
            return Verdict::kPlaneFit;
        case PlaneStatus::kOk:
            break;
    }
    return Verdict::kAccepted;
}

Verdict Gate::accept(const Candidate& c, const Rejector& rejector, Correspondence* out) {
    if (c.index >= verdicts_.size()) return Verdict::kFewNeighbours;
    Verdict& verdict = verdicts_[c.index];
    if (c.fresh) verdict = fit(c, rejector);
    if (verdict != Verdict::kAccepted) return verdict;

    const Plane& plane = planes_[c.index];
    const Eigen::Vector3f p(c.p_map[0], c.p_map[1], c.p_map[2]);
    const float residual = plane.signed_distance(p);
    const double score = 1.0 - G::kResidualSlope * std::abs(static_cast<double>(residual)) /
                                   std::sqrt(c.lidar_range);
    const bool inside = rejector.host_gates() ? score > G::kResidualScore : std::isfinite(residual);
    if (!inside) return verdict = Verdict::kResidual;
    Eigen::Map<Eigen::Vector3f>(out->normal) = plane.normal;
    out->residual = residual;
    return verdict;
}

CorrespondenceCounts Gate::counts() const {
    CorrespondenceCounts c;
    int* const fields[] = {&c.accepted,       &c.few_neighbours, &c.far_neighbours, &c.threshold,
                           &c.singular_plane, &c.plane_fit,      &c.residual};
    for (const Verdict v : verdicts_) ++*fields[static_cast<std::size_t>(v)];
    c.offered = static_cast<int>(verdicts_.size());
    return c;
}

void Gate::threshold_statistics(ScanDiagnostics& out) {
    const auto finite_end = std::partition(thresholds_.begin(), thresholds_.end(),
                                           [](float t) { return std::isfinite(t); });
    if (finite_end == thresholds_.begin()) return;
    const auto middle = thresholds_.begin() + (finite_end - thresholds_.begin()) / 2;
    std::nth_element(thresholds_.begin(), middle, finite_end);
    const auto [low, high] = std::minmax_element(thresholds_.begin(), finite_end);
    out.epsilon_min = static_cast<double>(*low);
    out.epsilon_median = static_cast<double>(*middle);
    out.epsilon_max = static_cast<double>(*high);
}

}  // namespace d2lio::fastlio
