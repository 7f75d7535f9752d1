// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/plugin/verdict_book.hpp"
#include "d2lio/rejection/rejector.hpp"
#include "surfaces.hpp"

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
    /// At which surfaces behind the points to look.
    enum class Look { kNot, kSample, kAll };

    /// @param sensor position, map frame.
    void begin_scan(std::size_t points, const Vec3& sensor, Look look);
    Verdict accept(const Candidate& candidate, const Rejector& rejector, Correspondence* out);
    /// Learns from the surfaces that were accepted.
    void end_scan();
    void reset() { surfaces_.reset(); }

    VerdictBook& book() { return book_; }
    /// Of an accepted point, where all surfaces are looked at.
    const Patch& patch(std::size_t i) { return surfaces_.patch(i); }
    /// Map frame.
    const Eigen::Vector3f& point(std::size_t i) const { return points_[i]; }
    /// Looks at the scan's surfaces.
    /// @param residuals of the accepted points, the negative distances that accept() gave: where
    /// only now is known how the surfaces bend, they are corrected.
    SurfaceSums survey(double* residuals);
    /// From now on to the scan's end the normals of accepted points come without their components
    /// along the blind directions, but for those that may have proven themselves.
    void clean(const BlindDirections& blind, const NoiseAwareConfig& config);
    /// The normal of a point that has not proven itself, where that is known already.
    void tell(std::size_t i, const Vec3& cleaned) {
        told_[i] = Told::kCleaned;
        cleaned_[i] = cleaned.cast<float>();
    }
    bool surveyed() const { return surfaces_.surveyed(); }
    bool cleans() const { return test_.has_value(); }
    /// Whether an accepted point's normal is to come whole.
    bool speaks(std::size_t i);

  private:
    Verdict fit(const Candidate& candidate, const Rejector& rejector);
    const Eigen::Vector3f& normal(std::size_t i);

    VerdictBook book_;
    std::vector<Plane> planes_;
    bool looks_ = false;  ///< at surfaces
    Surfaces surfaces_;
    std::vector<Eigen::Vector3f> points_;

    enum class Told : char { kUnknown, kCleaned, kWhole };
    std::optional<ProofTest> test_;
    BlindDirections blind_;
    std::vector<Told> told_;                ///< of the point's normal
    std::vector<Eigen::Vector3f> cleaned_;  ///< normals
};

}  // namespace d2lio::fastlio
