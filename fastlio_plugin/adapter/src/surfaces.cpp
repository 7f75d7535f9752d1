// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "surfaces.hpp"

namespace d2lio::fastlio {
namespace {

constexpr std::size_t kFew = 128;  ///< points that tell enough of a scan that sees well
constexpr std::size_t kLongestStep = 16;

std::size_t step_for(std::size_t points) {
    std::size_t step = 1;
    while (step < kLongestStep && 2 * step * kFew <= points) step *= 2;
    return step;
}

Sag sag_of(const BendField& bends, const Patch& patch, const Eigen::Vector3f& normal,
           const Eigen::Vector3f& p) {
    const Eigen::Vector3f d = p - patch.centroid;
    const float curve = patch.side.sign * bends.at(patch.side.facing);
    return {bends.sag(patch, normal, p), curve * (d - normal.dot(d) * normal - patch.sag_slope)};
}

}  // namespace

void Surfaces::begin_scan(std::size_t points, const Eigen::Vector3f& sensor, bool all) {
    all_ = all;
    bends_known_ = bends_.any();
    surveyed_ = false;
    step_ = all ? 1 : step_for(points);
    first_ = scans_++ % step_;
    sensor_ = sensor;
    noted_.assign(points, Noted::kNothing);
    if (bends_known_) sags_.resize(SurfaceSample::padded(points));
    sample_.resize((points + step_ - 1 - first_) / step_);
    if (all) patches_.resize(points);
}

void Surfaces::note(std::size_t i, const float* xyz, int stride, const PlaneMoments& moments,
                    const Plane& plane, const Eigen::Vector3f& p) {
    noted_[i] = Noted::kPlane;
    const bool sampled = in_sample(i) && (all_ || !surveyed_);
    if (!sampled && !bends_known_) return;
    const Eigen::Vector3f neighbour(xyz[0], xyz[1], xyz[2]);
    const SurfaceSide side = side_of(plane.normal, sensor_ - neighbour);
    if (sampled) sample_.set(i / step_, xyz, stride, moments, plane.normal, side, p);
    if (!bends_known_) return;
    sags_[i] = Sag();
    const bool later = all_ && !surveyed_;  // with the survey
    if (later || bends_.at(side.facing) == 0.F) return;
    Patch patch;
    make_patch(xyz, stride, Patch::kCount, moments, plane.normal, side, patch);
    sags_[i] = sag_of(bends_, patch, plane.normal, p);
}

SurfaceSums Surfaces::survey(const std::vector<Verdict>& verdicts) {
    for (std::size_t i = first_, k = 0; i < noted_.size(); i += step_, ++k) {
        if (verdicts[i] != Verdict::kAccepted || !noted(i)) sample_.leave_out(k);
    }
    surveyed_ = true;
    return sample_.survey(bends_, sags_come_late() ? sags_.data() : nullptr);
}

}  // namespace d2lio::fastlio
