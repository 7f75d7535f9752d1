// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace d2lio::liosam {

/// Outcome of one change to a graph. Whatever the outcome, the graph stays usable.
enum class GraphStatus {
    kOk,
    kReset,      ///< speed or bias beyond its bound, or a pose that contradicts the inertial data:
                 ///< started anew at the given pose
    kRecovered,  ///< the solver failed, gave non-finite values, or had no usable pose to work with:
                 ///< went on from the last good state
    kRejected    ///< input that means nothing here (not started, not finite, no such keyframe):
                 ///< nothing changed
};

}  // namespace d2lio::liosam
