// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "gate.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio::fastlio {

using G = GateConstants;

namespace {

constexpr std::size_t kSample = 128;  ///< points that tell enough of a scan that sees well
constexpr std::size_t kLongestStep = 16;

}  // namespace

void Gate::begin_scan(std::size_t points, const Vec3& sensor, Look look) {
    book_.begin_scan(points);
    planes_.resize(points);
    look_ = look;
    test_.reset();
    bends_known_ = look != Look::kNot && bends_.any();
    if (look == Look::kNot) return;
    const bool all = look == Look::kAll;
    step_ = all ? 1 : std::min(std::max<std::size_t>(points / kSample, 1), kLongestStep);
    has_patch_.assign(points, 0);
    sensor_ = sensor.cast<float>();
    patches_.resize(points);
    if (bends_known_) sags_.resize(points);
    if (all) points_.resize(points);
}

void Gate::end_scan() {
    if (look_ == Look::kNot) return;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        if (has_patch_[i] && book_.verdict(i) == Verdict::kAccepted) bends_.add(patches_[i]);
    }
    bends_.end_scan();
}

SurfaceSums Gate::sums() const {
    SurfaceSums out;
    for (std::size_t i = 0; i < has_patch_.size(); i += step_) {
        if (!has_patch_[i] || book_.verdicts()[i] != Verdict::kAccepted) continue;
        out.add(planes_[i].normal.cast<double>(), patches_[i]);
    }
    return out;
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
    const bool looks = look_ != Look::kNot && (bends_known_ || in_sample(c.index));
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
    const bool known = looks && has_patch_[c.index] && planes_[c.index] == before;
    if (looks && !known) look_at(c, moments);
    return Verdict::kAccepted;
}

void Gate::clean(const BlindDirections& blind, const NoiseAwareConfig& config) {
    if (cleans()) return;
    test_.emplace(blind, config);
    told_.assign(planes_.size(), Told::kUnknown);
    cleaned_.resize(planes_.size());
}

const Eigen::Vector3f& Gate::normal(std::size_t i) {
    const Eigen::Vector3f& whole = planes_[i].normal;
    if (told_[i] == Told::kUnknown) {
        const bool speaks = has_patch_[i] && test_->may_pass(whole, patches_[i]);
        told_[i] = speaks ? Told::kWhole : Told::kCleaned;
        if (!speaks) cleaned_[i] = test_->without(whole);
    }
    return told_[i] == Told::kWhole ? whole : cleaned_[i];
}

void Gate::look_at(const Candidate& c, const PlaneMoments& moments) {
    if (cleans()) told_[c.index] = Told::kUnknown;
    const Eigen::Vector3f& normal = planes_[c.index].normal;
    const SurfaceSide side =
        side_of(normal, sensor_ - Eigen::Map<const Eigen::Vector3f>(c.neighbours));
    has_patch_[c.index] = in_sample(c.index) || bends_.at(side.facing) != 0.F;
    if (!has_patch_[c.index]) return;
    make_patch(c.neighbours, static_cast<int>(c.neighbour_step), G::kNeighbours, moments, normal,
               side, patches_[c.index]);
}

/// What the bend of the surface adds to its distance from the plane.
float Gate::sag(std::size_t i, const Eigen::Vector3f& p) const {
    return has_patch_[i] ? bends_.sag(patches_[i], planes_[i].normal, p) : 0.F;
}

Verdict Gate::accept(const Candidate& c, const Rejector& rejector, Correspondence* out) {
    if (c.index >= book_.size()) return Verdict::kFewNeighbours;
    Verdict& verdict = book_.verdict(c.index);
    if (c.fresh) {
        if (!searched_.load(std::memory_order_relaxed)) searched_ = true;
        book_.set_range(c.index, c.imu_range);
        verdict = fit(c, rejector);
    }
    if (verdict != Verdict::kAccepted) return verdict;

    const Plane& plane = planes_[c.index];
    const Eigen::Vector3f p(c.p_map[0], c.p_map[1], c.p_map[2]);
    float distance = plane.signed_distance(p);
    if (bends_known_) {
        if (c.fresh) sags_[c.index] = sag(c.index, p);
        distance -= sags_[c.index];
    }
    if (look_ == Look::kAll) points_[c.index] = p;
    const double score = 1.0 - G::kResidualSlope * std::abs(static_cast<double>(distance)) /
                                   std::sqrt(c.lidar_range);
    const bool inside = rejector.host_gates() ? score > G::kResidualScore : std::isfinite(distance);
    if (!inside) return verdict = Verdict::kResidual;
    Eigen::Map<Eigen::Vector3f>(out->normal) = cleans() ? normal(c.index) : plane.normal;
    out->residual = distance;
    return verdict;
}

}  // namespace d2lio::fastlio
