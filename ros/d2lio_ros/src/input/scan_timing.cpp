// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/scan_timing.hpp"

#include "d2lio/preprocess/pseudo_times.hpp"

namespace d2lio::ros1 {
namespace {

constexpr char kNoTimes[] =
    "the cloud has no per-point times; set lidar/synchronised: true if it is motion compensated, "
    "or lidar/pseudo_times: true to estimate them from the azimuth";

void finish(RawScan& raw, Stamp stamp, const std::vector<std::int32_t>& dt_ns, Scan& out) {
    out.stamp = stamp;
    out.points = std::move(raw.points);
    for (std::size_t i = 0; i < dt_ns.size(); ++i) out.points[i].dt_ns = dt_ns[i];
}

}  // namespace

PointTimes ScanTiming::ask(const RawScan& raw) const {
    PointTimeHint hint = hint_;
    if (raw.times_in_ns_from_stamp) {
        hint.unit = TimeUnit::kNanoseconds;
        hint.reference = TimeReference::kStart;
    }
    if (!raw.integer_times.empty()) {
        return resolve_point_times(raw.integer_times.data(), raw.points.size(), raw.stamp, hint);
    }
    const double* times = raw.real_times.empty() ? nullptr : raw.real_times.data();
    return resolve_point_times(times, raw.points.size(), raw.stamp, hint);
}

ScanTiming::Outcome ScanTiming::resolve(RawScan raw, Scan& out) {
    if (raw.points.empty()) return Outcome::kEmpty;
    if (hint_.synchronised) {
        finish(raw, raw.stamp, {}, out);
        return Outcome::kOk;
    }
    const PointTimes found = ask(raw);
    if (!found.ok()) return refuse(raw, found, out);
    if (!locked_) {
        locked_ = true;
        hint_ = locked(hint_, found);
        message_ = to_string(found);
    }
    finish(raw, found.scan_stamp, found.dt_ns, out);
    return Outcome::kOk;
}

ScanTiming::Outcome ScanTiming::refuse(RawScan& raw, const PointTimes& found, Scan& out) {
    const bool missing = found.status == PointTimeStatus::kAbsent ||
                         found.status == PointTimeStatus::kAllEqual ||
                         found.status == PointTimeStatus::kNotFinite;
    if (!hint_.pseudo_allowed || !missing) {
        message_ = found.status == PointTimeStatus::kAbsent ? kNoTimes : to_string(found);
        return Outcome::kRefused;
    }
    std::vector<std::int32_t> dt_ns;
    pseudo_times_by_azimuth(raw.points, hint_.period_s, dt_ns);
    locked_ = true;
    message_ = "point times: estimated from the azimuth (the cloud has none)";
    finish(raw, raw.stamp, dt_ns, out);
    return Outcome::kOk;
}

}  // namespace d2lio::ros1
