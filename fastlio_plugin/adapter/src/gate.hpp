// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

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
    void begin_scan(std::size_t points);
    Verdict accept(const Candidate& candidate, const Rejector& rejector, Correspondence* out);

    VerdictBook& book() { return book_; }

  private:
    Verdict fit(const Candidate& candidate, const Rejector& rejector);

    VerdictBook book_;
    std::vector<Plane> planes_;
};

}  // namespace d2lio::fastlio
