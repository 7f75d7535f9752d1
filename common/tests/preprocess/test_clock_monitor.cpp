// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "streams.hpp"

namespace d2lio {
namespace {

constexpr Stamp kUptime = 1622 * kSecond;  // an IMU that counts from its own start
const OnGroup kIgnore = [](const MeasureGroup&) {};

SyncHealth health_after(Stamp imu_start, Stamp scan_start, Stamp duration) {
    Synchronizer sync;
    play(sync, imu_start, scan_start, duration, kIgnore);
    return sync.report().health;
}

TEST(ClockMonitor, UptimeAgainstWallTimeIsNamedWithBothStamps) {
    Synchronizer sync;
    play(sync, kUptime, kStart, 4 * kSecond, kIgnore);
    const SyncReport report = sync.report();
    EXPECT_EQ(report.health, SyncHealth::kNoOverlap);
    EXPECT_EQ(report.imu_stamp, kUptime + 4 * kSecond - kImuPeriod);
    EXPECT_NEAR(seconds_between(report.scan_stamp, kStart), 3.9, 0.1);
    EXPECT_NE(to_string(report).find("different clocks"), std::string::npos);
    EXPECT_NE(to_string(report).find("1625.995"), std::string::npos);
}

TEST(ClockMonitor, EitherClockMayBeAhead) {
    EXPECT_EQ(health_after(kStart, kUptime, 4 * kSecond), SyncHealth::kNoOverlap);
    EXPECT_EQ(health_after(kStart + 10 * kSecond, kStart, 4 * kSecond), SyncHealth::kNoOverlap);
    EXPECT_EQ(health_after(kStart - 10 * kSecond, kStart, 4 * kSecond), SyncHealth::kNoOverlap);
}

TEST(ClockMonitor, NotJudgedOnTooLittleDataUnlessItEnds) {
    Synchronizer sync;
    play(sync, kUptime, kStart, 180 * kMs, kIgnore);  // a recording of two scans
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
    sync.finish();
    drain(sync, kIgnore);
    EXPECT_EQ(sync.report().health, SyncHealth::kNoOverlap);
}

TEST(ClockMonitor, CommonClocksPassWithLatencyAndLateStarts) {
    EXPECT_EQ(health_after(kStart, kStart, 10 * kSecond), SyncHealth::kOk);
    EXPECT_EQ(health_after(kStart - kSecond, kStart, 10 * kSecond), SyncHealth::kOk);
    Synchronizer sync;  // LiDAR runs 5 s before the IMU is switched on
    for (int i = 0; i < 50; ++i) sync.push_scan(scan_at(kStart + i * kScanPeriod));
    EXPECT_EQ(sync.report().health, SyncHealth::kNoImu);
    std::size_t used = 0;
    play(sync, kStart + 5 * kSecond, kStart + 5 * kSecond, 5 * kSecond,
         [&](const MeasureGroup& group) {
             used += !group.imu.empty();
             EXPECT_NE(sync.report().health, SyncHealth::kNoOverlap);
         });
    EXPECT_GE(used, 49U);
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
}

TEST(ClockMonitor, AStepOfOneClockDuringTheRunIsNamed) {
    Synchronizer sync;
    play(sync, kUptime, kUptime, 5 * kSecond, kIgnore);
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
    play(sync, kUptime + 5 * kSecond, kStart, 5 * kSecond, kIgnore);  // LiDAR found its PTP master
    EXPECT_EQ(sync.report().health, SyncHealth::kNoOverlap);
}

TEST(ClockMonitor, AShortImuLossIsNoClockFault) {
    Synchronizer sync;
    play(sync, kStart, kStart, 5 * kSecond, kIgnore);
    const Stamp now = kStart + 5 * kSecond;
    sync.push_scan(scan_at(now - kScanPeriod));
    sync.push_imu(imu_at(now));
    drain(sync, kIgnore);
    sync.push_scan(scan_at(now));
    sync.push_imu(imu_at(now + 500 * kMs));
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
}

TEST(ClockMonitor, ATrailingScanIsNoFault) {
    Synchronizer sync;
    play(sync, kStart, kStart, kSecond, kIgnore);
    sync.push_scan(scan_at(kStart + kSecond));
    sync.finish();
    drain(sync, kIgnore);
    EXPECT_EQ(sync.counts().scans_uncovered, 1U);
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
}

TEST(ClockMonitor, AMissingStreamIsNamed) {
    Synchronizer no_imu, no_lidar;
    for (int i = 0; i < 30; ++i) no_imu.push_scan(scan_at(kStart + i * kScanPeriod));
    for (int i = 0; i < 600; ++i) no_lidar.push_imu(imu_at(kStart + i * kImuPeriod));
    EXPECT_EQ(no_imu.report().health, SyncHealth::kNoImu);
    EXPECT_NE(to_string(no_imu.report()).find("IMU topic"), std::string::npos);
    EXPECT_EQ(no_lidar.report().health, SyncHealth::kNoLidar);
    no_imu.finish();
    EXPECT_TRUE(take_all(no_imu).empty());
    EXPECT_EQ(no_imu.counts().scans_uncovered, 30U);
    EXPECT_EQ(no_imu.report().health, SyncHealth::kNoImu);
}

}  // namespace
}  // namespace d2lio
