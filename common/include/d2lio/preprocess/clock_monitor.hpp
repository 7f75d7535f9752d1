// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "d2lio/types.hpp"

namespace d2lio {

enum class SyncHealth {
    kOk,
    kNoImu,     ///< scans wait, samples do not come
    kNoLidar,   ///< samples come, scans do not
    kNoOverlap  ///< both come, but their stamps share no moment: different clocks
};

struct SyncReport {
    SyncHealth health = SyncHealth::kOk;
    Stamp imu_stamp = 0;   ///< newest sample, ns; 0 if there was none
    Stamp scan_stamp = 0;  ///< newest scan's end, ns; 0 if there was none
};

/// One line for the user: the state and both stamps in seconds.
std::string to_string(const SyncReport& report);

/// Watches two streams for progress and for clocks that never meet (sensor uptime against wall
/// time, say). Streams are compared since the last progress, and judged only once both have moved
/// on side by side, so that feeding one whole stream before the other is no fault.
class ClockMonitor {
  public:
    /// @param stall_after_s data without progress before it is a fault, s
    explicit ClockMonitor(double stall_after_s) : stall_after_s_(stall_after_s) {}

    void add_imu(Stamp stamp);
    void add_scan(Stamp begin, Stamp end);
    /// A group with samples was handed out: the clocks agree.
    void progress();
    /// Stamps start anew.
    void restart();
    /// No more data will come: judge what there is.
    void finish() { finished_ = true; }
    SyncReport report() const;

  private:
    struct Stream {
        std::optional<Stamp> first, last;  ///< since the last progress
        std::optional<Stamp> mark;         ///< `last` when both streams had begun
        Stamp newest = 0;                  ///< ever
        void see(Stamp begin, Stamp end);
        double seconds() const;             ///< covered since the last progress
        double seconds_after_mark() const;  ///< covered side by side with the other stream
    };
    void mark_if_both();
    bool disjoint() const;

    double stall_after_s_;
    Stream imu_, scan_;
    bool finished_ = false, progressed_ = false;
};

}  // namespace d2lio
