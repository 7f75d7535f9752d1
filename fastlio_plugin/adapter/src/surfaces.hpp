// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstring>
#include <optional>
#include <vector>

#include "d2lio/degeneracy/bend.hpp"
#include "d2lio/degeneracy/blind.hpp"
#include "d2lio/degeneracy/patch.hpp"
#include "d2lio/degeneracy/surface_sample.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/plugin/plugin.hpp"

namespace d2lio::fastlio {

/// Index of the first entry from i on that is `value`, or the size.
template <typename T>
std::size_t next(const std::vector<T>& in, std::size_t i, T value) {
    static_assert(sizeof(T) == 1);  // what memchr() is quick with
    if (i >= in.size()) return in.size();
    const void* const found = std::memchr(&in[i], static_cast<int>(value), in.size() - i);
    return found == nullptr ? in.size()
                            : static_cast<std::size_t>(static_cast<const T*>(found) - in.data());
}

/// Which points of a scan are to have a patch: a small sample, or
struct PatchChoice {
    bool many = false;  ///< a larger one, and of the others those that may prove themselves
    /// along the directions that were doubtful in the last scan. Absent: all.
    std::optional<ProofTest> test;
};

/// What is known, beside their planes, of the surfaces behind the points of one scan. A patch costs
/// more than its plane, so not every point has one: a sample tells what is noise and what bends,
/// and of the others nearly all lie along the directions that are doubtful anyway. Of the sample
/// no more is kept than is needed, as the map has to stay in the cache. Calls for different points
/// may run at a time.
class Surfaces {
  public:
    /// @param sensor position, map frame.
    void begin_scan(std::size_t points, const Eigen::Vector3f& sensor, const PatchChoice& choice);
    /// Whether anything is to be noted of a point.
    bool wants(std::size_t i) const { return bends_known_ || choice_.many || in_sample(i); }
    bool surveyed() const { return surveyed_; }
    bool noted(std::size_t i) const { return noted_[i] != Noted::kNothing; }
    /// Notes a plane and its neighbours.
    /// @param p the point itself.
    void note(std::size_t i, const float* xyz, int stride, const PlaneMoments& moments,
              const Plane& plane, const Eigen::Vector3f& p);
    /// How far the surface lies from its plane at the point, along the normal (m).
    float sag(std::size_t i) const { return sags_[i]; }
    bool bends_known() const { return bends_known_; }  ///< else sag() is zero everywhere
    /// Null where there is none.
    const Patch* patch(std::size_t i) const {
        return noted_[i] == Noted::kPatch ? &patches_[i] : nullptr;
    }

    /// The first point from i on that has one.
    std::size_t next_patch(std::size_t i) const { return next(noted_, i, Noted::kPatch); }

    /// Over the accepted points of the sample, of which the bends are learnt. Once in a scan.
    SurfaceSums survey(const std::vector<Verdict>& verdicts);
    void end_scan() { bends_.end_scan(); }
    void reset() { bends_.reset(); }

  private:
    enum class Noted : char { kNothing, kPlane, kPatch };
    bool in_sample(std::size_t i) const { return (i & (step_ - 1)) == first_; }
    /// A direction turns from scan to scan: half of what it takes is enough.
    bool may_prove(const Eigen::Vector3f& normal) const {
        constexpr float kShare = 0.5F;
        return !choice_.test || choice_.test->may_pass(normal, kShare);
    }

    PatchChoice choice_;
    bool bends_known_ = false, surveyed_ = false;
    std::size_t step_ = 1;   ///< from one point of the sample to the next, a power of two
    std::size_t first_ = 0;  ///< of the sample, in turn: the map's noise is the same in many scans
    std::size_t scans_ = 0;
    Eigen::Vector3f sensor_ = Eigen::Vector3f::Zero();
    std::vector<Noted> noted_;
    std::vector<float> sags_;
    SurfaceSample sample_;  ///< in the order of the points
    std::vector<Patch> patches_;
    BendField bends_;
};

}  // namespace d2lio::fastlio
