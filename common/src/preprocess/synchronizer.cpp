// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/synchronizer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "d2lio/config/params.hpp"

namespace d2lio {
namespace {

constexpr Stamp kMaxStamp = Stamp{1} << 61;  // far from overflow in any sum or difference
// Samples jitter about their period; a scan that lacks this many periods still counts as covered.
constexpr double kCoverageSlack = 1.5;
// FAST-LIO2: a scan whose last point lies before this share of the mean duration is incomplete.
constexpr double kShortScanShare = 0.5;

bool usable(Stamp stamp) { return stamp > -kMaxStamp && stamp < kMaxStamp; }

Stamp nanoseconds(double seconds) { return std::llround(seconds / kNanosecond); }

std::int32_t latest_offset(const Scan& scan) {
    std::int32_t latest = 0;
    for (const LidarPoint& point : scan.points) latest = std::max(latest, point.dt_ns);
    return latest;
}

void require(double value, bool allowed, const std::string& key, const char* range) {
    if (!std::isfinite(value) || !allowed) throw ConfigError(key, std::to_string(value), range);
}

}  // namespace

SynchronizerOptions SynchronizerOptions::online() {
    SynchronizerOptions options;
    options.max_scans = 5;
    options.max_imu = 20000;
    return options;
}

Synchronizer::Synchronizer(const SynchronizerOptions& options, const std::string& key_prefix)
    : options_(options), monitor_(options.stall_after_s) {
    require(options.rewind_tolerance_s, options.rewind_tolerance_s >= 0.0,
            key_prefix + "rewind_tolerance_s", ">= 0");
    require(options.stall_after_s, options.stall_after_s > 0.0, key_prefix + "stall_after_s",
            "> 0");
    require(options.imu_gap_warn_s, options.imu_gap_warn_s > 0.0, key_prefix + "imu_gap_warn_s",
            "> 0");
    require(options.lidar_gap_warn_s, options.lidar_gap_warn_s > 0.0,
            key_prefix + "lidar_gap_warn_s", "> 0");
}

PushStatus Synchronizer::push_imu(const ImuSample& sample) {
    PushStatus status = judge(sample);
    if (status != PushStatus::kAccepted && status != PushStatus::kNewEpoch) return status;
    if (status == PushStatus::kNewEpoch) start_epoch();
    if (newest_imu_) {
        ++imu_intervals_;
        const double dt = seconds_between(sample.stamp, *newest_imu_);
        mean_imu_dt_s_ += (dt - mean_imu_dt_s_) / static_cast<double>(imu_intervals_);
    }
    if (options_.max_imu > 0 && imu_.size() >= options_.max_imu) {
        imu_.pop_front();
        ++counts_.imu_overflow;
        status = PushStatus::kQueueFullDropped;
    }
    imu_.push_back(sample);
    newest_imu_ = sample.stamp;
    monitor_.add_imu(sample.stamp);
    ++counts_.imu_accepted;
    return status;
}

PushStatus Synchronizer::judge(const ImuSample& sample) {
    if (finished_) return PushStatus::kFinished;
    if (!usable(sample.stamp) || !sample.gyro.allFinite() || !sample.accel.allFinite()) {
        ++counts_.imu_bad;
        return PushStatus::kBadValue;
    }
    if (rewound(sample.stamp, newest_imu_)) return PushStatus::kNewEpoch;
    if (!newest_imu_ || sample.stamp > *newest_imu_) return PushStatus::kAccepted;
    const bool same = sample.stamp == *newest_imu_;
    ++(same ? counts_.imu_duplicate : counts_.imu_late);
    return same ? PushStatus::kDuplicateDropped : PushStatus::kLateDropped;
}

PushStatus Synchronizer::push_scan(Scan scan) {
    Pending pending;
    PushStatus status = judge(scan, pending.end);
    if (status != PushStatus::kAccepted && status != PushStatus::kNewEpoch) return status;
    if (status == PushStatus::kNewEpoch) start_epoch();
    pending.scan = std::move(scan);
    learn_duration(pending);
    if (options_.max_scans > 0 && scans_.size() >= options_.max_scans) {
        scans_.pop_front();
        ++counts_.scans_overflow;
        status = PushStatus::kQueueFullDropped;
    }
    newest_scan_ = pending.scan.stamp;
    newest_end_ = pending.end;
    monitor_.add_scan(pending.scan.stamp, pending.end);
    scans_.push_back(std::move(pending));
    ++counts_.scans_accepted;
    return status;
}

PushStatus Synchronizer::judge(const Scan& scan, Stamp& end) {
    if (finished_) return PushStatus::kFinished;
    if (!usable(scan.stamp)) {
        ++counts_.scans_bad;
        return PushStatus::kBadValue;
    }
    end = scan_end(scan);
    if (rewound(scan.stamp, newest_scan_)) return PushStatus::kNewEpoch;
    if (!newest_scan_) return PushStatus::kAccepted;
    if (scan.stamp == *newest_scan_) {
        ++counts_.scans_duplicate;
        return PushStatus::kDuplicateDropped;
    }
    // A scan that ends inside the previous one would lead the estimate back in time.
    if (scan.stamp > *newest_scan_ && end > *newest_end_) return PushStatus::kAccepted;
    ++counts_.scans_late;
    return PushStatus::kLateDropped;
}

std::optional<MeasureGroup> Synchronizer::pop() {
    if (finished_) drop_uncovered();
    if (scans_.empty() || !ready(scans_.front())) return std::nullopt;
    MeasureGroup group;
    group.end = scans_.front().end;
    group.scan = std::move(scans_.front().scan);
    group.begin = group.scan.stamp;
    scans_.pop_front();
    group.new_epoch = std::exchange(epoch_pending_, false);
    if (last_group_end_) {
        group.lidar_gap_s = std::max(0.0, seconds_between(group.begin, *last_group_end_));
    }
    take_samples(group);
    last_group_end_ = group.end;
    count_group(group);
    return group;
}

void Synchronizer::finish() {
    finished_ = true;
    monitor_.finish();
}

SyncReport Synchronizer::report() const { return monitor_.report(); }

bool Synchronizer::rewound(Stamp stamp, const std::optional<Stamp>& newest) const {
    return newest && seconds_between(*newest, stamp) > options_.rewind_tolerance_s;
}

void Synchronizer::start_epoch() {
    counts_.imu_cleared += imu_.size();
    counts_.scans_cleared += scans_.size();
    ++counts_.epochs;
    imu_.clear();
    scans_.clear();
    for (auto* stamp :
         {&newest_imu_, &newest_scan_, &newest_end_, &last_used_imu_, &last_group_end_}) {
        stamp->reset();
    }
    monitor_.restart();
    epoch_pending_ = true;
}

Stamp Synchronizer::scan_end(const Scan& scan) const {
    const Stamp full = scan.stamp + nanoseconds(mean_scan_s_);
    if (scan.points.size() <= 1) return full;
    if (options_.end_rule == ScanEndRule::kLatestPoint) return scan.stamp + latest_offset(scan);
    const std::int32_t last = std::max(0, scan.points.back().dt_ns);
    const bool incomplete = last * kNanosecond < kShortScanShare * mean_scan_s_;
    return incomplete ? full : scan.stamp + last;
}

void Synchronizer::learn_duration(const Pending& pending) {
    const double duration = seconds_between(pending.end, pending.scan.stamp);
    if (pending.scan.points.size() <= 1 || duration < kShortScanShare * mean_scan_s_) return;
    const bool assumed = options_.end_rule == ScanEndRule::kLastInMessage &&
                         pending.scan.points.back().dt_ns != pending.end - pending.scan.stamp;
    if (assumed) return;
    ++full_scans_;
    mean_scan_s_ += (duration - mean_scan_s_) / static_cast<double>(full_scans_);
}

bool Synchronizer::ready(const Pending& pending) const {
    if (!newest_imu_) return false;
    const double missing = seconds_between(pending.end, *newest_imu_);
    return missing <= (finished_ ? kCoverageSlack * mean_imu_dt_s_ : 0.0);
}

void Synchronizer::drop_uncovered() {
    while (!scans_.empty() && !ready(scans_.front())) {
        scans_.pop_front();
        ++counts_.scans_uncovered;
    }
}

void Synchronizer::take_samples(MeasureGroup& group) {
    Stamp previous = last_used_imu_.value_or(group.begin);
    Stamp longest = 0;
    while (!imu_.empty() && imu_.front().stamp <= group.end) {
        const ImuSample& sample = imu_.front();
        longest = std::max(longest, sample.stamp - previous);
        previous = sample.stamp;
        group.imu.push_back(sample);
        imu_.pop_front();
    }
    longest = std::max(longest, group.end - previous);
    group.imu_gap_s = static_cast<double>(longest) * kNanosecond;
    if (!group.imu.empty()) last_used_imu_ = group.imu.back().stamp;
}

void Synchronizer::count_group(const MeasureGroup& group) {
    ++counts_.groups;
    if (group.imu_gap_s > options_.imu_gap_warn_s) ++counts_.imu_gaps;
    if (group.lidar_gap_s > options_.lidar_gap_warn_s) ++counts_.lidar_gaps;
    if (group.imu.empty()) {
        ++counts_.scans_without_imu;
    } else {
        monitor_.progress();
    }
}

}  // namespace d2lio
