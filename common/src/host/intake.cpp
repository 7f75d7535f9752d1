// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/intake.hpp"

#include <algorithm>

#include "d2lio/host/stop_watch.hpp"
#include "d2lio/preprocess/extrinsic.hpp"

namespace d2lio {
namespace {

constexpr double kGapPeriods = 3.0;  ///< IMU periods that are no gap yet

SynchronizerOptions with_queues(SynchronizerOptions options, bool live) {
    if (!live) return options;
    const SynchronizerOptions online = SynchronizerOptions::online();
    options.max_scans = online.max_scans;
    options.max_imu = online.max_imu;
    return options;
}

std::string gap_message(const char* sensor, double seconds) {
    return std::string(sensor) + " gap of " + std::to_string(seconds) + " s";
}

}  // namespace

void IntakeConfig::bind(ParamTable& t) {
    t.add("preprocess.blind", filter.blind, {0.0, kInf}, "m", "nearer returns are dropped");
    t.add("preprocess.max_range", filter.max_range, {0.0, kInf}, "m",
          "farther returns are dropped");
    t.add("point_filter_num", filter.stride, {1, 1000}, "", "every n-th point of a scan is used");
    t.add("mapping.extrinsic_T", extrinsic_T, 3, {-1e3, 1e3}, "m", "translation of T_imu_lidar");
    t.add("mapping.extrinsic_R", extrinsic_R, 9, {-2.0, 2.0}, "", "rotation of T_imu_lidar, rows");
    t.add("imu.init_samples", init_samples, {2, 10000}, "", "samples averaged at the start");
    t.add("imu.gap_warn", sync.imu_gap_warn_s, {0.001, kInf}, "s",
          "a longer gap in the IMU data (and 3 periods) is told and makes the prediction looser");
    t.add("imu.gap_reset", gaps.imu_reset, {0.05, kInf}, "s",
          "a longer gap in the IMU data starts a new epoch");
    t.add("lidar.gap_warn", sync.lidar_gap_warn_s, {0.001, kInf}, "s",
          "a longer gap in the LiDAR data is told");
    t.add("lidar.gap_reset", gaps.lidar_reset, {0.5, kInf}, "s",
          "a longer gap in the LiDAR data starts a new epoch");
    t.add("live", live, "bounded queues: drop the oldest scan rather than fall behind");
}

Pose IntakeConfig::extrinsic() const {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    return checked_extrinsic(Eigen::Map<const RowMajor>(extrinsic_R),
                             Eigen::Map<const Vec3>(extrinsic_T), "mapping.extrinsic_R");
}

void IntakeConfig::validate() const {
    extrinsic();
    if (!(filter.max_range > filter.blind)) {
        throw ConfigError("preprocess.max_range", std::to_string(filter.max_range),
                          "more than preprocess.blind = " + std::to_string(filter.blind));
    }
}

Intake::Intake(const IntakeConfig& config)
    : sync_options_(with_queues(config.sync, config.live)),
      gaps_(config.gaps),
      filter_(config.filter, "preprocess."),
      sync_(sync_options_) {}

PushStatus Intake::add_scan(Scan scan) {
    StopWatch watch;
    const std::size_t raw = scan.points.size();
    const Stamp stamp = scan.stamp;
    filtered_ += filter_.apply(scan.points);
    const PushStatus status = sync_.push_scan(std::move(scan));
    if (accepted(status)) arrivals_.push_back({stamp, raw, watch.lap()});
    while (arrivals_.size() > sync_.pending_scans()) arrivals_.pop_front();
    return status;
}

/// Finds what add_scan noted of this scan; scans dropped in between leave their notes behind.
void Intake::recall_arrival(const MeasureGroup& group, ScanResult& r) {
    while (!arrivals_.empty()) {
        const Arrival a = arrivals_.front();
        arrivals_.pop_front();
        if (a.stamp != group.scan.stamp) continue;
        r.points_raw = a.points;
        r.times.preprocess = a.ms;
        return;
    }
}

std::optional<MeasureGroup> Intake::next(ScanResult& r) {
    std::optional<MeasureGroup> group = sync_.pop();
    if (!group) return std::nullopt;
    r.stamp = group->end;
    r.imu_gap_s = group->imu_gap_s;
    r.lidar_gap_s = group->lidar_gap_s;
    r.points_valid = group->scan.points.size();
    recall_arrival(*group, r);
    return group;
}

std::string Intake::reset_reason(const MeasureGroup& group, bool running) const {
    if (group.new_epoch) return "stamps jumped back";
    if (!running) return {};
    if (group.imu_gap_s > gaps_.imu_reset) return gap_message("IMU", group.imu_gap_s);
    if (group.lidar_gap_s > gaps_.lidar_reset) return gap_message("LiDAR", group.lidar_gap_s);
    return {};
}

double Intake::loosen(const MeasureGroup& group, double mean_period, ScanResult& r) const {
    const double bound = std::max(sync_options_.imu_gap_warn_s, kGapPeriods * mean_period);
    if (group.imu_gap_s > bound) say(r, gap_message("IMU", group.imu_gap_s));
    if (group.lidar_gap_s > sync_options_.lidar_gap_warn_s) {
        say(r, gap_message("LiDAR", group.lidar_gap_s));
    }
    return std::max(1.0, group.imu_gap_s / bound);
}

}  // namespace d2lio
