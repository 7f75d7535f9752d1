// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "d2lio/preprocess/clock_monitor.hpp"
#include "d2lio/types.hpp"

namespace d2lio {

/// Which point ends a scan.
enum class ScanEndRule {
    kLatestPoint,  ///< the largest offset: independent of the order of points
    /// The last point in message order, as FAST-LIO2; the mean duration of the scans so far where
    /// that point lies before half of it.
    kLastInMessage
};

struct SynchronizerOptions {
    double rewind_tolerance_s = 0.5;  ///< a step back up to this is a late message, beyond it a
                                      ///< new epoch; s, >= 0
    double stall_after_s = 2.0;       ///< data without progress before it is reported, s, > 0
    double imu_gap_warn_s = 0.1;      ///< a longer IMU gap is counted, s, > 0
    double lidar_gap_warn_s = 0.5;    ///< a longer LiDAR gap is counted, s, > 0
    std::size_t max_scans = 0;        ///< pending scans, 0: unbounded (offline)
    std::size_t max_imu = 0;          ///< pending samples, 0: unbounded (offline)
    ScanEndRule end_rule = ScanEndRule::kLatestPoint;

    /// Bounds for live use: 5 scans (the newest win) and 20 000 samples.
    static SynchronizerOptions online();
};

enum class PushStatus {
    kAccepted,
    kLateDropped,       ///< older than the newest of its stream, within the tolerance
    kDuplicateDropped,  ///< same stamp as the newest of its stream
    kBadValue,          ///< NaN, Inf or an impossible stamp
    kNewEpoch,          ///< accepted; stamps jumped back, both buffers were cleared first
    kQueueFullDropped,  ///< accepted; the oldest pending message made room
    kFinished           ///< refused after finish()
};

/// Whether a message with this status is in the queue.
constexpr bool accepted(PushStatus status) {
    return status == PushStatus::kAccepted || status == PushStatus::kNewEpoch ||
           status == PushStatus::kQueueFullDropped;
}

/// Everything refused or lost, by reason.
struct SyncCounts {
    std::size_t imu_accepted = 0, imu_late = 0, imu_duplicate = 0, imu_bad = 0, imu_overflow = 0;
    std::size_t scans_accepted = 0, scans_late = 0, scans_duplicate = 0, scans_bad = 0;
    std::size_t scans_overflow = 0;     ///< dropped by a full queue
    std::size_t scans_uncovered = 0;    ///< dropped at the end: IMU data stop before the scan does
    std::size_t scans_without_imu = 0;  ///< groups handed out with no sample
    std::size_t groups = 0, epochs = 0;
    std::size_t imu_cleared = 0, scans_cleared = 0;  ///< dropped by new epochs
    std::size_t imu_gaps = 0, lidar_gaps = 0;        ///< groups with a gap beyond the threshold
};

/// One scan and the inertial samples that lead up to its end.
struct MeasureGroup {
    Scan scan;
    Stamp begin = 0, end = 0;    ///< the scan's first and last time
    std::vector<ImuSample> imu;  ///< rising stamps in (previous group's end, end]
    bool new_epoch = false;      ///< first group after stamps jumped back
    /// Longest stretch without a sample from the previous group's last sample (from `begin` if
    /// there is none) to `end`, s.
    double imu_gap_s = 0.0;
    double lidar_gap_s = 0.0;  ///< from the previous group's end to `begin`, s, >= 0
};

/// Pairs scans with inertial samples on a common clock. A scan is handed out once a sample at or
/// after its end has arrived; samples after the end stay for the next scan (as FAST-LIO2 does).
/// Bad input is dropped and counted, never waited for. Not thread-safe.
class Synchronizer {
  public:
    /// @throws ConfigError for an option outside its range, with `key_prefix` before its name.
    explicit Synchronizer(const SynchronizerOptions& options = {},
                          const std::string& key_prefix = "sync.");

    PushStatus push_imu(const ImuSample& sample);
    PushStatus push_scan(Scan scan);
    /// The oldest complete group, or nothing. Call until empty after every push.
    std::optional<MeasureGroup> pop();
    /// No more samples will come: scans that lack at most one IMU period become ready, the rest are
    /// dropped by the next pop() and counted. Later pushes are refused.
    void finish();

    const SyncCounts& counts() const { return counts_; }
    std::size_t pending_scans() const { return scans_.size(); }
    std::size_t pending_imu() const { return imu_.size(); }
    /// Whether data flow, and if not, why; both clocks with it.
    SyncReport report() const;

  private:
    struct Pending {
        Scan scan;
        Stamp end = 0;
    };
    PushStatus judge(const ImuSample& sample);
    PushStatus judge(const Scan& scan, Stamp& end);
    bool rewound(Stamp stamp, const std::optional<Stamp>& newest) const;
    void start_epoch();
    Stamp scan_end(const Scan& scan) const;
    void learn_duration(const Pending& pending);
    bool ready(const Pending& pending) const;
    void drop_uncovered();
    void take_samples(MeasureGroup& group);
    void count_group(const MeasureGroup& group);

    SynchronizerOptions options_;
    SyncCounts counts_;
    std::deque<ImuSample> imu_;
    std::deque<Pending> scans_;
    std::optional<Stamp> newest_imu_, newest_scan_, newest_end_;  ///< of what was accepted
    std::optional<Stamp> last_used_imu_, last_group_end_;         ///< of what was handed out
    ClockMonitor monitor_;
    double mean_scan_s_ = 0.0;  ///< mean duration of full scans, s
    std::size_t full_scans_ = 0;
    double mean_imu_dt_s_ = 0.0;  ///< mean sample period, s
    std::size_t imu_intervals_ = 0;
    bool epoch_pending_ = false, finished_ = false;
};

}  // namespace d2lio
