// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "surfaces.hpp"

namespace d2lio::fastlio {
namespace {

/// Points that tell enough: of a scan that sees well, and of one that may have to be cleaned.
constexpr std::size_t kFew = 128, kMany = 512;
constexpr std::size_t kLongestStep = 16, kLongStep = 4;

std::size_t step_for(std::size_t points, std::size_t enough, std::size_t longest) {
    std::size_t step = 1;
    while (step < longest && 2 * step * enough <= points) step *= 2;
    return step;
}

/// Patch::sag() with the mean of what the plane takes out: what one plane takes more and another
/// less, by the places of its five neighbours, is millimetres of noise and costs a patch. Nor is it
/// found anew where the point moves a little and its plane stays.
inline float sag_of(const BendField& bends, const Eigen::Vector3f& p, const Plane& plane,
                    const SurfaceSide& side, const PlaneMoments& moments) {
    const float bend = bends.at(side.facing);
    if (bend == 0.F) return 0.F;
    const float distance = plane.signed_distance(p);
    const float square = (p - moments.centroid).squaredNorm() - distance * distance;
    return side.sign * bend * (0.5F * square - bends.level(side.facing) * moments.trace());
}

}  // namespace

void Surfaces::begin_scan(std::size_t points, const Eigen::Vector3f& sensor,
                          const PatchChoice& choice) {
    choice_ = choice;
    bends_known_ = bends_.any();
    surveyed_ = false;
    step_ = choice.many ? step_for(points, kMany, kLongStep) : step_for(points, kFew, kLongestStep);
    first_ = scans_++ % step_;
    sensor_ = sensor;
    noted_.assign(points, Noted::kNothing);
    if (bends_known_) sags_.resize(points);
    sample_.resize((points + step_ - 1 - first_) / step_);
    patches_.resize(points);
}

void Surfaces::note(std::size_t i, const float* xyz, int stride, const PlaneMoments& moments,
                    const Plane& plane, const Eigen::Vector3f& p) {
    const bool kept = choice_.many && may_prove(plane.normal);
    const bool sampled = !surveyed_ && in_sample(i);
    noted_[i] = kept ? Noted::kPatch : Noted::kPlane;
    if (!kept && !sampled && !bends_known_) return;
    const Eigen::Vector3f neighbour(xyz[0], xyz[1], xyz[2]);
    const SurfaceSide side = side_of(plane.normal, sensor_ - neighbour);
    if (bends_known_) sags_[i] = sag_of(bends_, p, plane, side, moments);
    if (sampled) sample_.set(i / step_, xyz, stride, moments, plane.normal, side, p);
    if (kept) make_patch(xyz, stride, Patch::kCount, moments, plane.normal, side, patches_[i]);
}

SurfaceSums Surfaces::survey(const std::vector<Verdict>& verdicts) {
    for (std::size_t i = first_, k = 0; i < noted_.size(); i += step_, ++k) {
        if (verdicts[i] != Verdict::kAccepted || !noted(i)) sample_.leave_out(k);
    }
    surveyed_ = true;
    return sample_.survey(bends_);
}

}  // namespace d2lio::fastlio
