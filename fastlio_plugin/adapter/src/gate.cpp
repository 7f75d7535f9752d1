// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <cmath>

namespace d2lio::fastlio {

using G = GateConstants;

void Gate::begin_scan(std::size_t points, const Vec3& sensor, bool patches) {
    book_.begin_scan(points);
    planes_.resize(points);
    keeps_patches_ = patches;
    if (!patches) return;
    planes_.assign(points, Plane{});  // no plane of the last scan passes for one of this
    sensor_ = sensor.cast<float>();
    patches_.resize(points);
    points_.resize(points);
}

void Gate::end_scan() {
    if (!keeps_patches_) return;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        if (book_.verdict(i) == Verdict::kAccepted) bends_.add(patches_[i]);
    }
    bends_.end_scan();
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
    switch (fit_plane(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, options,
                      planes_[c.index])) {
        case PlaneStatus::kSingular:
            return Verdict::kSingularPlane;
        case PlaneStatus::kRough:
            return Verdict::kPlaneFit;
        case PlaneStatus::kOk:
            break;
    }
    // The same plane to the bit is a fit to the same neighbours: a search late in a scan finds few
    // others than the one before.
    if (keeps_patches_ && !(planes_[c.index] == before)) {
        patches_[c.index] = make_patch(c.neighbours, static_cast<int>(c.neighbour_step),
                                       G::kNeighbours, planes_[c.index].normal, sensor_);
    }
    return Verdict::kAccepted;
}

/// Signed distance from the surface: from its plane, and from what its bend adds to that.
float Gate::residual(std::size_t i, const Eigen::Vector3f& p) const {
    const float distance = planes_[i].signed_distance(p);
    return keeps_patches_ ? distance - bends_.sag(patches_[i], planes_[i].normal, p) : distance;
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
    const float distance = residual(c.index, p);
    if (keeps_patches_) points_[c.index] = p;
    const double score = 1.0 - G::kResidualSlope * std::abs(static_cast<double>(distance)) /
                                   std::sqrt(c.lidar_range);
    const bool inside = rejector.host_gates() ? score > G::kResidualScore : std::isfinite(distance);
    if (!inside) return verdict = Verdict::kResidual;
    Eigen::Map<Eigen::Vector3f>(out->normal) = plane.normal;
    out->residual = distance;
    return verdict;
}

}  // namespace d2lio::fastlio
