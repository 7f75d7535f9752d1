// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <cmath>

namespace d2lio::fastlio {

using G = GateConstants;

void Gate::begin_scan(std::size_t points, const Vec3& sensor, Look look) {
    book_.begin_scan(points);
    planes_.resize(points);
    test_.reset();
    looks_ = look != Look::kNot;
    if (!looks_) return;
    surfaces_.begin_scan(points, sensor.cast<float>(), look == Look::kAll);
    points_.resize(points);
}

SurfaceSums Gate::survey(double* residuals) {
    const SurfaceSums sums = surfaces_.survey(book_.verdicts());
    if (!surfaces_.sags_come_late()) return sums;
    for (std::size_t i = 0; i < points_.size(); ++i) {
        if (book_.verdicts()[i] != Verdict::kAccepted) continue;
        *residuals++ += static_cast<double>(surfaces_.sag(i));
    }
    return sums;
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
    if (!looks) return Verdict::kAccepted;
    const Eigen::Vector3f p(c.p_map[0], c.p_map[1], c.p_map[2]);
    const bool known = book_.verdict(c.index) == Verdict::kAccepted && planes_[c.index] == before;
    if (known && surfaces_.noted(c.index)) {
        surfaces_.move(c.index, p - points_[c.index]);
        return Verdict::kAccepted;
    }
    surfaces_.note(c.index, c.neighbours, static_cast<int>(c.neighbour_step), moments,
                   planes_[c.index], p);
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

bool Gate::speaks(std::size_t i) {
    if (told_[i] != Told::kUnknown) return told_[i] == Told::kWhole;
    const Eigen::Vector3f& whole = planes_[i].normal;
    if (!test_->may_pass(whole) || !test_->may_pass(whole, patch(i))) return false;
    told_[i] = Told::kWhole;
    return true;
}

const Eigen::Vector3f& Gate::normal(std::size_t i) {
    if (told_[i] == Told::kCleaned) return cleaned_[i];
    if (speaks(i)) return planes_[i].normal;
    tell(i, without(planes_[i].normal.cast<double>(), blind_));
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
