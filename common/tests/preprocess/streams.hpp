// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "d2lio/preprocess/synchronizer.hpp"

namespace d2lio {

constexpr Stamp kMs = 1'000'000;
constexpr Stamp kSecond = 1000 * kMs;
constexpr Stamp kStart = 1'700'000'000 * kSecond;
constexpr Stamp kImuPeriod = 5 * kMs;
constexpr Stamp kScanPeriod = 100 * kMs;
constexpr std::int32_t kSweep = 99'900'000;  // last point of a full scan, ns

inline ImuSample imu_at(Stamp stamp) {
    ImuSample sample;
    sample.stamp = stamp;
    sample.accel.z() = 9.81;
    return sample;
}

inline LidarPoint point_at(std::int32_t dt_ns) {
    LidarPoint p;
    p.x = 5.F;
    p.dt_ns = dt_ns;
    return p;
}

/// Three points: at the start, in the middle and at `sweep`.
inline Scan scan_at(Stamp stamp, std::int32_t sweep = kSweep) {
    return {stamp, {point_at(0), point_at(sweep / 2), point_at(sweep)}};
}

using OnGroup = std::function<void(const MeasureGroup&)>;

inline void drain(Synchronizer& sync, const OnGroup& on_group) {
    while (auto group = sync.pop()) on_group(*group);
}

/// Two steady streams over [0, duration) in order of arrival: a scan arrives at its end, both
/// stamps are shifted by their offset. Groups are taken as they come.
inline void play(Synchronizer& sync, Stamp imu_start, Stamp scan_start, Stamp duration,
                 const OnGroup& on_group) {
    for (Stamp t = 0; t < duration; t += kImuPeriod) {
        if (t > 0 && t % kScanPeriod == 0) sync.push_scan(scan_at(scan_start + t - kScanPeriod));
        sync.push_imu(imu_at(imu_start + t));
        drain(sync, on_group);
    }
}

inline std::vector<MeasureGroup> take_all(Synchronizer& sync) {
    std::vector<MeasureGroup> groups;
    drain(sync, [&](const MeasureGroup& group) { groups.push_back(group); });
    return groups;
}

}  // namespace d2lio
