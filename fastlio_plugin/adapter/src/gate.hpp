// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <optional>
#include <vector>

#include "d2lio/degeneracy/bend.hpp"
#include "d2lio/degeneracy/blind.hpp"
#include "d2lio/degeneracy/patch.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/plugin/verdict_book.hpp"
#include "d2lio/rejection/rejector.hpp"

namespace d2lio::fastlio {

/// FAST-LIO2's constants of the correspondence test (UPSTREAM.md: neighbours, gate, plane, s).
struct GateConstants {
    static constexpr int kNeighbours = 5;
    static constexpr float kMaxSqDistance = 5.0F;  ///< m^2, of the farthest neighbour
    static constexpr float kPlaneDistance = 0.1F;  ///< m, of every neighbour from the plane
    static constexpr double kResidualSlope = 0.9, kResidualScore = 0.9;
};

/// Per-point state of one scan: verdicts, planes and thresholds. accept() touches only the entry of
/// its own point, so any number of threads may call it.
class Gate {
  public:
    /// How closely the surfaces behind the points are looked at.
    enum class Look {
        kNot,
        kSample,  ///< some, and those that face where the surface is known to bend
        kAll,
    };

    /// @param sensor position, map frame.
    void begin_scan(std::size_t points, const Vec3& sensor, Look look);
    Verdict accept(const Candidate& candidate, const Rejector& rejector, Correspondence* out);
    /// Learns from the surfaces that were accepted.
    void end_scan();
    void reset() { bends_.reset(); }

    VerdictBook& book() { return book_; }
    /// Of an accepted point; null where none was made.
    const Patch* patch(std::size_t i) const { return has_patch_[i] ? &patches_[i] : nullptr; }
    /// Map frame; only where every surface is looked at.
    const Eigen::Vector3f& point(std::size_t i) const { return points_[i]; }
    /// Over the accepted points of the sample, or over all.
    SurfaceSums sums() const;
    /// From now on to the scan's end the normals of accepted points come without their components
    /// along the blind directions, but for those that may have proven themselves.
    void clean(const BlindDirections& blind, const NoiseAwareConfig& config);
    bool cleans() const { return test_.has_value(); }
    /// Whether a point's normal came whole.
    bool speaks(std::size_t i) const { return told_[i] == Told::kWhole; }
    /// Whether a point has come with new neighbours since the last call.
    bool searched() { return searched_.exchange(false); }

  private:
    Verdict fit(const Candidate& candidate, const Rejector& rejector);
    void look_at(const Candidate& candidate, const PlaneMoments& moments);
    const Eigen::Vector3f& normal(std::size_t i);
    float sag(std::size_t i, const Eigen::Vector3f& p) const;
    bool in_sample(std::size_t i) const { return i % step_ == 0; }

    VerdictBook book_;
    std::vector<Plane> planes_;
    Look look_ = Look::kNot;
    std::size_t step_ = 1;      ///< from one point of the sample to the next
    bool bends_known_ = false;  ///< of any facing
    std::atomic<bool> searched_{false};
    Eigen::Vector3f sensor_ = Eigen::Vector3f::Zero();
    std::vector<Patch> patches_;
    std::vector<char> has_patch_;  ///< not bool: threads write neighbouring entries
    /// Of the surfaces from their planes at the points, as of the last search: it changes by less
    /// than a millimetre within a scan.
    std::vector<float> sags_;
    std::vector<Eigen::Vector3f> points_;
    BendField bends_;

    enum class Told : char { kUnknown, kCleaned, kWhole };
    std::optional<ProofTest> test_;
    std::vector<Told> told_;                ///< of the point's normal
    std::vector<Eigen::Vector3f> cleaned_;  ///< normals
};

}  // namespace d2lio::fastlio
