// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/types.hpp"

namespace d2lio::liosam {

/// Ends the limit cycles of scan matching. Correspondences that flip between two iterations keep
/// some scans (one in ten of a room) stepping back and forth until the iterations run out. After
/// kFreeIterations, each step that turns back against the one before, in the metric of the normal
/// equations, halves all further steps of the scan, which then converges where it oscillates.
class StepControl {
  public:
    void begin() { *this = StepControl(); }

    /// @param step of this iteration, as solved. @param AtA its normal matrix, same variables.
    /// @returns what to multiply the step by: 1, 1/2, 1/4, ...
    double factor(const Vec6& step, const Mat6& AtA) {
        if (++iteration_ > kFreeIterations && step.dot(AtA * last_) < 0.0) factor_ *= 0.5;
        last_ = step;
        return factor_;
    }

  private:
    static constexpr int kFreeIterations = 6;  ///< four of five scans end by themselves in these

    Vec6 last_ = Vec6::Zero();
    double factor_ = 1.0;
    int iteration_ = 0;
};

}  // namespace d2lio::liosam
