// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "streams.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-9;  // s
const OnGroup kIgnore = [](const MeasureGroup&) {};

TEST(SynchronizerFaults, DuplicateAndLateSamplesAreSkippedAndCounted) {
    Synchronizer sync;
    EXPECT_EQ(sync.push_imu(imu_at(kStart)), PushStatus::kAccepted);
    EXPECT_EQ(sync.push_imu(imu_at(kStart)), PushStatus::kDuplicateDropped);
    EXPECT_EQ(sync.push_imu(imu_at(kStart + 10 * kMs)), PushStatus::kAccepted);
    EXPECT_EQ(sync.push_imu(imu_at(kStart + 5 * kMs)), PushStatus::kLateDropped);
    EXPECT_EQ(sync.counts().imu_accepted, 2U);
    EXPECT_EQ(sync.counts().imu_duplicate, 1U);
    EXPECT_EQ(sync.counts().imu_late, 1U);
    EXPECT_EQ(sync.pending_imu(), 2U);
}

TEST(SynchronizerFaults, DuplicateLateAndNestedScansAreSkippedAndCounted) {
    Synchronizer sync;
    EXPECT_EQ(sync.push_scan(scan_at(kStart)), PushStatus::kAccepted);
    EXPECT_EQ(sync.push_scan(scan_at(kStart)), PushStatus::kDuplicateDropped);
    EXPECT_EQ(sync.push_scan(scan_at(kStart - 100 * kMs)), PushStatus::kLateDropped);
    EXPECT_EQ(sync.push_scan(scan_at(kStart + 10 * kMs, 20 * kMs)), PushStatus::kLateDropped);
    EXPECT_EQ(sync.counts().scans_duplicate, 1U);
    EXPECT_EQ(sync.counts().scans_late, 2U);
    EXPECT_EQ(sync.pending_scans(), 1U);
}

TEST(SynchronizerFaults, BadValuesAreSkippedAndCounted) {
    Synchronizer sync;
    ImuSample nan = imu_at(kStart), inf = imu_at(kStart);
    nan.gyro.x() = std::numeric_limits<double>::quiet_NaN();
    inf.accel.y() = std::numeric_limits<double>::infinity();
    EXPECT_EQ(sync.push_imu(nan), PushStatus::kBadValue);
    EXPECT_EQ(sync.push_imu(inf), PushStatus::kBadValue);
    EXPECT_EQ(sync.push_imu(imu_at(std::numeric_limits<Stamp>::min())), PushStatus::kBadValue);
    EXPECT_EQ(sync.push_scan(scan_at(std::numeric_limits<Stamp>::max())), PushStatus::kBadValue);
    EXPECT_EQ(sync.counts().imu_bad, 3U);
    EXPECT_EQ(sync.counts().scans_bad, 1U);
    EXPECT_EQ(sync.pending_imu() + sync.pending_scans(), 0U);
}

class Rewind : public testing::TestWithParam<bool> {};

TEST_P(Rewind, ABagLoopStartsOneNewEpochForBothStreams) {
    const bool imu_first = GetParam();
    Synchronizer sync;
    play(sync, kStart, kStart, kSecond, kIgnore);
    sync.push_scan(scan_at(kStart + 900 * kMs));  // still pending when the bag loops
    const std::size_t before = sync.counts().groups;
    if (imu_first) {
        EXPECT_EQ(sync.push_imu(imu_at(kStart - kMs)), PushStatus::kNewEpoch);
    } else {
        EXPECT_EQ(sync.push_scan(scan_at(kStart - kScanPeriod)), PushStatus::kNewEpoch);
    }
    EXPECT_EQ(sync.pending_imu(), imu_first ? 1U : 0U);
    EXPECT_EQ(sync.pending_scans(), imu_first ? 0U : 1U);
    EXPECT_EQ(sync.counts().scans_cleared, 1U);
    std::size_t flagged = 0, groups = 0;
    play(sync, kStart, kStart, kSecond, [&](const MeasureGroup& group) {
        EXPECT_EQ(group.new_epoch, groups == 0);
        flagged += group.new_epoch;
        ++groups;
        EXPECT_LT(group.lidar_gap_s, 0.01);
    });
    EXPECT_EQ(flagged, 1U);
    EXPECT_EQ(sync.counts().epochs, 1U);
    EXPECT_EQ(sync.counts().groups, before + 9 + (imu_first ? 0 : 1));
}

INSTANTIATE_TEST_SUITE_P(SynchronizerFaults, Rewind, testing::Bool());

TEST(SynchronizerFaults, ANewEpochForgetsTheOldOne) {
    Synchronizer sync;
    play(sync, kStart, kStart, kSecond, kIgnore);
    for (int i = 10; i < 40; ++i) sync.push_scan(scan_at(kStart + i * kScanPeriod));
    EXPECT_EQ(sync.report().health, SyncHealth::kNoImu);
    EXPECT_EQ(sync.push_scan(scan_at(kStart)), PushStatus::kNewEpoch);
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
    for (Stamp t = 60 * kMs; t <= 100 * kMs; t += kImuPeriod) sync.push_imu(imu_at(kStart + t));
    const auto group = sync.pop();
    ASSERT_TRUE(group);
    EXPECT_NEAR(group->imu_gap_s, 0.06, kExact);  // from the scan's begin, not from the old loop
}

TEST(SynchronizerFaults, AStragglerOfTheOldLoopDoesNotBlockTheNewOne) {
    Synchronizer sync;
    play(sync, kStart, kStart, 2 * kSecond, kIgnore);
    sync.push_imu(imu_at(kStart));
    sync.push_scan(scan_at(kStart + 2 * kSecond));
    std::size_t with_imu = 0;
    play(sync, kStart, kStart, 2 * kSecond,
         [&](const MeasureGroup& group) { with_imu += !group.imu.empty(); });
    EXPECT_GE(with_imu, 18U);
    EXPECT_EQ(sync.pending_scans(), 0U);
}

TEST(SynchronizerFaults, ImuGapsAreMeasuredAcrossGroups) {
    Synchronizer sync;
    std::vector<double> gaps;
    for (Stamp t = 0; t <= kSecond; t += kImuPeriod) {
        if (t > 0 && t % kScanPeriod == 0) sync.push_scan(scan_at(kStart + t - kScanPeriod));
        const bool lost = t > 250 * kMs && t < 650 * kMs;
        if (!lost) sync.push_imu(imu_at(kStart + t));
        drain(sync, [&](const MeasureGroup& group) { gaps.push_back(group.imu_gap_s); });
    }
    ASSERT_EQ(gaps.size(), 10U);
    EXPECT_NEAR(gaps[1], 5e-3, kExact);
    EXPECT_NEAR(gaps[2], 0.0499, kExact);  // last sample at 250, scan ends at 299.9 ms
    EXPECT_NEAR(gaps[5], 0.3499, kExact);  // nothing since
    EXPECT_NEAR(gaps[6], 0.4, kExact);     // 250 to 650 ms
    EXPECT_NEAR(gaps[7], 5e-3, kExact);
    EXPECT_EQ(sync.counts().imu_gaps, 4U);
    EXPECT_EQ(sync.counts().scans_without_imu, 3U);
}

TEST(SynchronizerFaults, LidarGapsAreMeasured) {
    Synchronizer sync;
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_scan(scan_at(kStart + 100 * kMs, 100 * kMs));
    sync.push_scan(scan_at(kStart + 900 * kMs, 100 * kMs));
    for (Stamp t = 0; t <= kSecond; t += kImuPeriod) sync.push_imu(imu_at(kStart + t));
    const auto groups = take_all(sync);
    ASSERT_EQ(groups.size(), 3U);
    EXPECT_EQ(groups[0].lidar_gap_s, 0.0);
    EXPECT_EQ(groups[1].lidar_gap_s, 0.0);
    EXPECT_NEAR(groups[2].lidar_gap_s, 0.7, kExact);
    EXPECT_EQ(groups[2].imu.size(), 160U);
    EXPECT_EQ(sync.counts().lidar_gaps, 1U);
}

TEST(SynchronizerFaults, OverloadDropsTheOldestScansAndShowsIt) {
    SynchronizerOptions options = SynchronizerOptions::online();
    options.max_imu = 50;
    Synchronizer sync(options);
    std::size_t full = 0;
    for (int i = 0; i < 20; ++i) {
        full += sync.push_scan(scan_at(kStart + i * kScanPeriod)) == PushStatus::kQueueFullDropped;
    }
    for (int i = 0; i < 500; ++i) sync.push_imu(imu_at(kStart + i * kImuPeriod));
    EXPECT_EQ(full, 20U - options.max_scans);
    EXPECT_EQ(sync.counts().scans_overflow, full);
    EXPECT_EQ(sync.counts().imu_overflow, 450U);
    EXPECT_EQ(sync.pending_imu(), 50U);
    EXPECT_EQ(sync.pop()->begin, kStart + 15 * kScanPeriod);  // the newest survive
}

TEST(SynchronizerFaults, OfflineLosesNothing) {
    Synchronizer sync;
    constexpr int kScans = 2000;
    for (int i = 0; i < kScans; ++i) sync.push_scan(scan_at(kStart + i * kScanPeriod));
    for (int i = 0; i <= kScans * 20; ++i) sync.push_imu(imu_at(kStart + i * kImuPeriod));
    EXPECT_EQ(take_all(sync).size(), static_cast<std::size_t>(kScans));
}

// Whatever arrives: stamps rise inside an epoch, counts balance, nothing stalls.
TEST(SynchronizerFaults, RandomStreamsKeepTheInvariants) {
    std::mt19937 rng(11);
    std::uniform_int_distribution<int> percent(0, 99);
    Synchronizer sync;
    Stamp now = kStart, last_sample = 0, last_end = 0;
    std::size_t samples = 0, scans = 0, used = 0;
    for (int i = 0; i < 40000; ++i) {
        const int event = percent(rng);
        now += event == 0 && percent(rng) < 5 ? -3 * kSecond : kImuPeriod;
        const Stamp jitter = event < 5 ? -20 * kMs : 0;
        if (event % 20 == 7) {
            sync.push_scan(scan_at(now + jitter));
            ++scans;
        } else {
            sync.push_imu(imu_at(now + jitter));
            ++samples;
        }
        drain(sync, [&](const MeasureGroup& group) {
            if (group.new_epoch) last_sample = last_end = 0;
            EXPECT_GT(group.end, last_end);
            last_end = group.end;
            for (const ImuSample& sample : group.imu) {
                EXPECT_GT(sample.stamp, last_sample);
                EXPECT_LE(sample.stamp, group.end);
                last_sample = sample.stamp;
            }
            used += group.imu.size();
        });
    }
    const SyncCounts& c = sync.counts();
    EXPECT_GT(c.epochs, 5U);
    EXPECT_GT(c.groups, 1000U);
    EXPECT_EQ(c.imu_accepted + c.imu_late + c.imu_duplicate, samples);
    EXPECT_EQ(c.scans_accepted + c.scans_late + c.scans_duplicate, scans);
    EXPECT_EQ(used + c.imu_cleared + sync.pending_imu(), c.imu_accepted);
    EXPECT_EQ(c.groups + c.scans_cleared + sync.pending_scans(), c.scans_accepted);
}

}  // namespace
}  // namespace d2lio
