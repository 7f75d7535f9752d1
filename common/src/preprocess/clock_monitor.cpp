// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/clock_monitor.hpp"

#include <algorithm>
#include <cstdio>

namespace d2lio {
namespace {

// A stream counts as silent while the other covers this many times more.
constexpr double kSilentShare = 0.5;

const char* reason(SyncHealth health) {
    switch (health) {
        case SyncHealth::kOk:
            return "in step";
        case SyncHealth::kNoImu:
            return "scans wait for IMU samples that do not come; check the IMU topic";
        case SyncHealth::kNoLidar:
            return "IMU samples come but no scans; check the LiDAR topic";
        case SyncHealth::kNoOverlap:
            return "IMU and LiDAR stamps share no moment: the sensors use different clocks";
    }
    return "unknown";
}

}  // namespace

void ClockMonitor::Stream::see(Stamp begin, Stamp end) {
    first = first ? std::min(*first, begin) : begin;
    last = last ? std::max(*last, end) : end;
    newest = end;
}

double ClockMonitor::Stream::seconds() const {
    return first ? seconds_between(*last, *first) : 0.0;
}

double ClockMonitor::Stream::seconds_after_mark() const {
    return mark ? seconds_between(*last, *mark) : 0.0;
}

void ClockMonitor::add_imu(Stamp stamp) {
    imu_.see(stamp, stamp);
    mark_if_both();
}

void ClockMonitor::add_scan(Stamp begin, Stamp end) {
    scan_.see(begin, end);
    mark_if_both();
}

void ClockMonitor::mark_if_both() {
    if (!imu_.mark && imu_.last && scan_.last) {
        imu_.mark = imu_.last;
        scan_.mark = scan_.last;
    }
}

void ClockMonitor::progress() {
    progressed_ = true;
    restart();
}

void ClockMonitor::restart() {
    for (Stream* stream : {&imu_, &scan_}) {
        stream->first.reset();
        stream->last.reset();
        stream->mark.reset();
    }
}

bool ClockMonitor::disjoint() const {
    return imu_.first && scan_.first && (*imu_.last < *scan_.first || *imu_.first > *scan_.last);
}

SyncReport ClockMonitor::report() const {
    SyncReport report{SyncHealth::kOk, imu_.newest, scan_.newest};
    const bool side_by_side =
        std::min(imu_.seconds_after_mark(), scan_.seconds_after_mark()) >= stall_after_s_;
    const bool never_met = finished_ && !progressed_;
    const double silent = kSilentShare * stall_after_s_;
    if (disjoint() && (side_by_side || never_met)) {
        report.health = SyncHealth::kNoOverlap;
    } else if ((scan_.seconds() >= stall_after_s_ && imu_.seconds() < silent) ||
               (never_met && scan_.first && !imu_.first)) {
        report.health = SyncHealth::kNoImu;
    } else if ((imu_.seconds() >= stall_after_s_ && scan_.seconds() < silent) ||
               (never_met && imu_.first && !scan_.first)) {
        report.health = SyncHealth::kNoLidar;
    }
    return report;
}

std::string to_string(const SyncReport& report) {
    char stamps[96];
    std::snprintf(stamps, sizeof stamps, " (newest IMU stamp %.3f s, newest scan ends at %.3f s)",
                  static_cast<double>(report.imu_stamp) * kNanosecond,
                  static_cast<double>(report.scan_stamp) * kNanosecond);
    return reason(report.health) + std::string(stamps);
}

}  // namespace d2lio
