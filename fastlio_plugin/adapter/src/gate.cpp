// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio::fastlio {

using G = GateConstants;

void Gate::begin_scan(std::size_t points, const Vec3& sensor, const PatchChoice* choice) {
    book_.begin_scan(points);
    planes_.resize(points);
    test_.reset();
    looks_ = choice != nullptr;
    if (!looks_) return;
    surfaces_.begin_scan(points, sensor.cast<float>(), *choice);
    points_.resize(points);
}

void Gate::end_scan() {
    if (looks_) surfaces_.end_scan();
}

Verdict Gate::fit(const Candidate& c, const Rejector& rejector) {
    if (c.neighbour_count < G::kNeighbours) return Verdict::kFewNeighbours;
    const float* sq = c.sq_distances;
    if (rejector.host_gates() && sq[(G::kNeighbours - 1) * c.distance_step] > G::kMaxSqDistance) {
        return Verdict::kFarNeighbours;
    }
    const double threshold = rejector.threshold(c.imu_range);
    book_.set_threshold(c.index, threshold);
    if (!(static_cast<double>(sq[0]) <= threshold * threshold)) return Verdict::kThreshold;

    const Plane before = planes_[c.index];
    PlaneFitOptions options;
    options.max_distance = G::kPlaneDistance;
    if (rejector.host_gates()) options.min_spread_ratio = 0.0;  // upstream has no such check
    PlaneMoments moments;
    const bool looks = looks_ && surfaces_.wants(c.index);
    switch (fit_plane(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, options,
                      planes_[c.index], looks ? &moments : nullptr)) {
        case PlaneStatus::kSingular:
            return Verdict::kSingularPlane;
        case PlaneStatus::kRough:
            return Verdict::kPlaneFit;
        case PlaneStatus::kOk:
            break;
    }
    // The same plane to the bit is a fit to the same neighbours: a search late in a scan finds few
    // others than the one before.
    if (!looks || (surfaces_.noted(c.index) && planes_[c.index] == before)) {
        return Verdict::kAccepted;
    }
    surfaces_.note(c.index, c.neighbours, static_cast<int>(c.neighbour_step), moments,
                   planes_[c.index], {c.p_map[0], c.p_map[1], c.p_map[2]});
    if (cleans()) told_[c.index] = Told::kUnknown;
    return Verdict::kAccepted;
}

void Gate::clean(const BlindDirections& blind, const NoiseAwareConfig& config) {
    if (cleans()) return;
    test_.emplace(blind, config);
    blind_ = blind;
    told_.assign(planes_.size(), Told::kUnknown);
    cleaned_.resize(planes_.size());
}

const Eigen::Vector3f& Gate::normal(std::size_t i) {
    if (told_[i] == Told::kCleaned) return cleaned_[i];
    const Eigen::Vector3f& whole = planes_[i].normal;
    if (told_[i] == Told::kWhole) return whole;
    const Patch* const surface = test_->may_pass(whole) ? patch(i) : nullptr;
    if (surface != nullptr && test_->may_pass(whole, *surface)) {
        told_[i] = Told::kWhole;
        return whole;
    }
    tell(i, without(whole.cast<double>(), blind_));
    return cleaned_[i];
}

Verdict Gate::accept(const Candidate& c, const Rejector& rejector, Correspondence* out) {
    if (c.index >= book_.size()) return Verdict::kFewNeighbours;
    Verdict& verdict = book_.verdict(c.index);
    if (c.fresh) {
        book_.set_range(c.index, c.imu_range);
        verdict = fit(c, rejector);
    }
    if (verdict != Verdict::kAccepted) return verdict;

    const Plane& plane = planes_[c.index];
    const Eigen::Vector3f p(c.p_map[0], c.p_map[1], c.p_map[2]);
    float distance = plane.signed_distance(p);
    if (looks_) {
        points_[c.index] = p;
        if (surfaces_.bends_known()) distance -= surfaces_.sag(c.index);
    }
    const double score = 1.0 - G::kResidualSlope * std::abs(static_cast<double>(distance)) /
                                   std::sqrt(c.lidar_range);
    const bool inside = rejector.host_gates() ? score > G::kResidualScore : std::isfinite(distance);
    if (!inside) return verdict = Verdict::kResidual;
    Eigen::Map<Eigen::Vector3f>(out->normal) = cleans() ? normal(c.index) : plane.normal;
    out->residual = distance;
    return verdict;
}

}  // namespace d2lio::fastlio
