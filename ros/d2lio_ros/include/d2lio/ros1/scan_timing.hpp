// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "d2lio/preprocess/point_times.hpp"
#include "d2lio/ros1/decode.hpp"

namespace d2lio::ros1 {

/// Turns the stored per-point times of scan after scan into offsets; what the first good scan shows
/// holds for the rest of the run.
class ScanTiming {
  public:
    enum class Outcome { kOk, kEmpty, kRefused };

    explicit ScanTiming(const PointTimeHint& hint) : hint_(hint) {}

    /// @param out complete where the outcome is kOk
    Outcome resolve(RawScan raw, Scan& out);
    /// What was found, or why the last scan was refused; empty before the first.
    const std::string& message() const { return message_; }

  private:
    PointTimes ask(const RawScan& raw) const;
    Outcome refuse(RawScan& raw, const PointTimes& found, Scan& out);

    PointTimeHint hint_;
    bool locked_ = false;
    std::string message_;
};

}  // namespace d2lio::ros1
