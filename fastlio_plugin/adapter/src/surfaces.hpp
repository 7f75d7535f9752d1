// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/degeneracy/bend.hpp"
#include "d2lio/degeneracy/patch.hpp"
#include "d2lio/degeneracy/surface_sample.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/plugin/plugin.hpp"

namespace d2lio::fastlio {

/// What is known, beside their planes, of the surfaces behind the points of one scan. A patch costs
/// more than its plane, so only those get one that are asked for it; of the others a survey tells,
/// all at once, what is noise, what bends and how far they lie from their planes. Of a scan that
/// sees well a sample is enough. Calls for different points may run at a time.
class Surfaces {
  public:
    /// @param sensor position, map frame. @param all points are to be noted, not just a sample.
    void begin_scan(std::size_t points, const Eigen::Vector3f& sensor, bool all);
    /// Whether anything is to be noted of a point.
    bool wants(std::size_t i) const { return bends_known_ || all_ || in_sample(i); }
    bool surveyed() const { return surveyed_; }
    bool noted(std::size_t i) const { return noted_[i] != Noted::kNothing; }
    /// Notes a plane and its neighbours.
    /// @param p the point itself.
    void note(std::size_t i, const float* xyz, int stride, const PlaneMoments& moments,
              const Plane& plane, const Eigen::Vector3f& p);
    /// How far the surface lies from its plane at the point, along the normal (m), as of the last
    /// search: it changes by less than a millimetre within a scan. Zero before the survey where
    /// sags_come_late().
    float sag(std::size_t i) const { return sags_[i].here; }
    bool sags_come_late() const { return all_ && bends_known_; }
    /// The point has moved, its neighbours are the same.
    void move(std::size_t i, const Eigen::Vector3f& by) {
        if (bends_known_) sags_[i].here += sags_[i].slope.dot(by);
    }
    bool bends_known() const { return bends_known_; }  ///< else sag() is zero everywhere
    /// Of a point that was noted where all are.
    const Patch& patch(std::size_t i) {
        if (noted_[i] != Noted::kPatch) sample_.get(i, patches_[i]);
        noted_[i] = Noted::kPatch;
        return patches_[i];
    }
    /// Over the accepted points of the sample, of which the bends are learnt. Once in a scan.
    SurfaceSums survey(const std::vector<Verdict>& verdicts);
    void end_scan() { bends_.end_scan(); }
    void reset() { bends_.reset(); }

  private:
    enum class Noted : char { kNothing, kPlane, kPatch };
    bool in_sample(std::size_t i) const { return (i & (step_ - 1)) == first_; }

    bool all_ = false;
    bool bends_known_ = false, surveyed_ = false;
    std::size_t step_ = 1;   ///< from one point of the sample to the next, a power of two
    std::size_t first_ = 0;  ///< of the sample, in turn: the map's noise is the same in many scans
    std::size_t scans_ = 0;
    Eigen::Vector3f sensor_ = Eigen::Vector3f::Zero();
    std::vector<Noted> noted_;
    std::vector<Sag> sags_;
    SurfaceSample sample_;  ///< in the order of the points
    std::vector<Patch> patches_;
    BendField bends_;
};

}  // namespace d2lio::fastlio
