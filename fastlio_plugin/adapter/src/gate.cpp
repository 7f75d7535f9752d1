// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <cmath>

namespace d2lio::fastlio {

using G = GateConstants;

namespace {

constexpr std::size_t kSampleStep = 4;  ///< points of a scan

}  // namespace

void Gate::begin_scan(std::size_t points, const Vec3& sensor, Look look) {
    book_.begin_scan(points);
    planes_.resize(points);
    look_ = look;
    if (look == Look::kNot) return;
    planes_.assign(points, Plane{});  // no plane of the last scan passes for one of this
    has_patch_.assign(points, 0);
    sensor_ = sensor.cast<float>();
    patches_.resize(points);
    points_.resize(points);
}

void Gate::end_scan() {
    if (look_ == Look::kNot) return;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        if (has_patch_[i] && book_.verdict(i) == Verdict::kAccepted) bends_.add(patches_[i]);
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
    PlaneMoments moments;
    switch (fit_plane(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, options,
                      planes_[c.index], look_ != Look::kNot ? &moments : nullptr)) {
        case PlaneStatus::kSingular:
            return Verdict::kSingularPlane;
        case PlaneStatus::kRough:
            return Verdict::kPlaneFit;
        case PlaneStatus::kOk:
            break;
    }
    // The same plane to the bit is a fit to the same neighbours: a search late in a scan finds few
    // others than the one before.
    if (look_ == Look::kNot || planes_[c.index] == before) return Verdict::kAccepted;
    const Eigen::Vector3f& normal = planes_[c.index].normal;
    const SurfaceSide side =
        side_of(normal, sensor_ - Eigen::Map<const Eigen::Vector3f>(c.neighbours));
    has_patch_[c.index] =
        look_ == Look::kAll || c.index % kSampleStep == 0 || bends_.at(side.facing) != 0.F;
    if (has_patch_[c.index]) {
        make_patch(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, moments,
                   normal, side, patches_[c.index]);
    }
    return Verdict::kAccepted;
}

/// Signed distance from the surface: from its plane, and from what its bend adds to that.
float Gate::residual(std::size_t i, const Eigen::Vector3f& p) const {
    const float distance = planes_[i].signed_distance(p);
    if (look_ == Look::kNot || !has_patch_[i]) return distance;
    return distance - bends_.sag(patches_[i], planes_[i].normal, p);
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
    if (look_ != Look::kNot) points_[c.index] = p;
    const double score = 1.0 - G::kResidualSlope * std::abs(static_cast<double>(distance)) /
                                   std::sqrt(c.lidar_range);
    const bool inside = rejector.host_gates() ? score > G::kResidualScore : std::isfinite(distance);
    if (!inside) return verdict = Verdict::kResidual;
    Eigen::Map<Eigen::Vector3f>(out->normal) = plane.normal;
    out->residual = distance;
    return verdict;
}

}  // namespace d2lio::fastlio
