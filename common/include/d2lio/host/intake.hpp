// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "d2lio/config/params.hpp"
#include "d2lio/host/result.hpp"
#include "d2lio/preprocess/point_filter.hpp"
#include "d2lio/preprocess/synchronizer.hpp"

namespace d2lio {

/// Everything a host refused or lost, by reason.
struct HostCounts {
    SyncCounts sync;
    FilterCounts points;
    std::size_t resets = 0;  ///< epochs begun for other reasons than stamps that jumped back
    std::vector<std::pair<const char*, std::size_t>> own;  ///< further counts of one host
};

/// Bounds on gaps, s. Beyond a warning a gap is told; beyond a reset the host starts anew.
struct GapBounds {
    double imu_reset = 1.0;
    double lidar_reset = 10.0;
};

/// Keys that every host has: what enters, and where the LiDAR sits.
struct IntakeConfig {
    PointFilterOptions filter;
    SynchronizerOptions sync;
    GapBounds gaps;
    bool live = false;  ///< bounded queues: the oldest scan is dropped rather than falling behind
    int init_samples = 10;              ///< inertial samples averaged at the start
    double extrinsic_T[3] = {0, 0, 0};  ///< t_imu_lidar, m
    double extrinsic_R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< R_imu_lidar, by rows

    void bind(ParamTable& table);
    /// T_imu_lidar. @throws ConfigError if the rotation is none, with its determinant.
    Pose extrinsic() const;
    /// Checks what no single key can. @throws ConfigError
    void validate() const;
};

/// A host's entrance: filters points, pairs scans with inertial samples, watches for gaps.
class Intake {
  public:
    /// @throws ConfigError for an option outside its range.
    explicit Intake(const IntakeConfig& config);

    PushStatus add_imu(const ImuSample& sample) { return sync_.push_imu(sample); }
    PushStatus add_scan(Scan scan);
    void finish() { sync_.finish(); }
    /// The next complete group; fills what the result says of it.
    std::optional<MeasureGroup> next(ScanResult& r);

    /// Why an estimate cannot be carried over to this group; empty if it can.
    /// @param running false while the host initialises: gaps do no harm then.
    std::string reset_reason(const MeasureGroup& group, bool running) const;
    /// Tells gaps; factor (>= 1) on the process noise, growing with the length of an IMU gap.
    /// @param mean_period of the IMU, s, 0 if unknown.
    double loosen(const MeasureGroup& group, double mean_period, ScanResult& r) const;

    const SyncCounts& sync_counts() const { return sync_.counts(); }
    const FilterCounts& filter_counts() const { return filtered_; }
    SyncReport report() const { return sync_.report(); }

  private:
    struct Arrival {
        Stamp stamp;
        std::size_t points;
        double ms;
    };
    void recall_arrival(const MeasureGroup& group, ScanResult& r);

    SynchronizerOptions sync_options_;
    GapBounds gaps_;
    PointFilter filter_;
    Synchronizer sync_;
    FilterCounts filtered_;
    std::deque<Arrival> arrivals_;
};

}  // namespace d2lio
