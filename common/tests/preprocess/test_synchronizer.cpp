// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "d2lio/config/params.hpp"
#include "streams.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-12;  // s

TEST(Synchronizer, EverySampleGoesOnceAndInOrder) {
    Synchronizer sync;
    std::vector<Stamp> used;
    std::size_t groups = 0;
    play(sync, kStart, kStart, 5 * kSecond, [&](const MeasureGroup& group) {
        EXPECT_EQ(group.begin, kStart + static_cast<Stamp>(groups) * kScanPeriod);
        EXPECT_EQ(group.end, group.begin + kSweep);
        EXPECT_EQ(group.scan.points.size(), 3U);
        EXPECT_FALSE(group.new_epoch);
        for (const ImuSample& sample : group.imu) {
            EXPECT_LE(sample.stamp, group.end);
            used.push_back(sample.stamp);
        }
        ++groups;
    });
    ASSERT_EQ(groups, 49U);
    for (std::size_t i = 0; i < used.size(); ++i) {
        ASSERT_EQ(used[i], kStart + static_cast<Stamp>(i) * kImuPeriod);
    }
    EXPECT_EQ(used.size(), 49U * 20U);
    EXPECT_EQ(sync.counts().groups, groups);
    EXPECT_EQ(sync.counts().imu_gaps + sync.counts().lidar_gaps, 0U);
    EXPECT_EQ(sync.report().health, SyncHealth::kOk);
}

TEST(Synchronizer, AScanWaitsForASampleAtOrAfterItsEnd) {
    Synchronizer sync;
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_imu(imu_at(kStart + 10 * kMs));
    sync.push_imu(imu_at(kStart + 100 * kMs - 1));
    EXPECT_FALSE(sync.pop());
    sync.push_imu(imu_at(kStart + 100 * kMs));
    const auto group = sync.pop();
    ASSERT_TRUE(group);
    EXPECT_EQ(group->imu.size(), 3U);  // the one at the end belongs to it
    EXPECT_EQ(sync.pending_imu(), 0U);
}

TEST(Synchronizer, TheSampleAfterTheEndStaysForTheNextScan) {
    Synchronizer sync;
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_imu(imu_at(kStart));
    sync.push_imu(imu_at(kStart + 100 * kMs + 1));
    ASSERT_EQ(sync.pop()->imu.size(), 1U);
    EXPECT_EQ(sync.pending_imu(), 1U);
    sync.push_scan(scan_at(kStart + 100 * kMs, 100 * kMs));
    sync.push_imu(imu_at(kStart + 205 * kMs));
    EXPECT_EQ(sync.pop()->imu.front().stamp, kStart + 100 * kMs + 1);
}

TEST(Synchronizer, TheFirstScanTakesAllEarlierSamples) {
    Synchronizer sync;
    for (int i = 0; i <= 30; ++i) sync.push_imu(imu_at(kStart + i * kImuPeriod));
    sync.push_scan(scan_at(kStart + 50 * kMs));
    const auto group = sync.pop();
    ASSERT_TRUE(group);
    EXPECT_EQ(group->imu.size(), 30U);
    EXPECT_NEAR(group->imu_gap_s, 5e-3, kExact);
}

TEST(Synchronizer, OrderOfArrivalDoesNotMatter) {
    const auto groups_when = [](bool scans_first) {
        Synchronizer sync;
        for (const bool scans : {scans_first, !scans_first}) {
            for (Stamp t = 0; t < 5 * kSecond; t += scans ? kScanPeriod : kImuPeriod) {
                scans ? sync.push_scan(scan_at(kStart + t)) : sync.push_imu(imu_at(kStart + t));
            }
        }
        EXPECT_NE(sync.report().health, SyncHealth::kNoOverlap);
        return take_all(sync);
    };
    const auto a = groups_when(true), b = groups_when(false);
    ASSERT_EQ(a.size(), 49U);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        ASSERT_EQ(a[i].end, b[i].end);
        ASSERT_EQ(a[i].imu.size(), b[i].imu.size());
    }
}

TEST(Synchronizer, UnsortedPointsEndAtTheLatest) {
    Synchronizer sync;
    sync.push_scan({kStart, {point_at(50 * kMs), point_at(99 * kMs), point_at(0), point_at(-1)}});
    sync.push_imu(imu_at(kStart + kSecond));
    EXPECT_EQ(sync.pop()->end, kStart + 99 * kMs);
}

TEST(Synchronizer, LastInMessageFallsBackToTheMeanDuration) {
    SynchronizerOptions options;
    options.end_rule = ScanEndRule::kLastInMessage;
    Synchronizer sync(options);
    const Stamp later = kStart + kSecond;
    sync.push_scan({kStart, {point_at(0), point_at(95 * kMs), point_at(90 * kMs)}});
    sync.push_scan(scan_at(later, 100 * kMs));
    sync.push_scan(scan_at(2 * kSecond + kStart, 40 * kMs));  // below half of 95 ms
    sync.push_scan({3 * kSecond + kStart, {point_at(3)}});    // too few points
    sync.push_scan({4 * kSecond + kStart, {}});
    sync.push_imu(imu_at(kStart + 10 * kSecond));
    const auto groups = take_all(sync);
    ASSERT_EQ(groups.size(), 5U);
    const Stamp expected[] = {90 * kMs, 100 * kMs, 95 * kMs, 95 * kMs, 95 * kMs};
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(groups[i].end - groups[i].begin, expected[i]);
}

TEST(Synchronizer, OnlyMeasuredDurationsEnterTheMean) {
    SynchronizerOptions options;
    options.end_rule = ScanEndRule::kLastInMessage;
    Synchronizer sync(options);
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_scan(scan_at(kStart + kSecond, 40 * kMs));  // taken as 100 ms, but not measured
    sync.push_scan(scan_at(kStart + 2 * kSecond, 160 * kMs));
    sync.push_scan({kStart + 3 * kSecond, {}});
    sync.push_imu(imu_at(kStart + 10 * kSecond));
    const auto groups = take_all(sync);
    EXPECT_EQ(groups.back().end - groups.back().begin, 130 * kMs);
}

TEST(Synchronizer, APartialScanDoesNotShortenTheMean) {
    Synchronizer sync;
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_scan(scan_at(kStart + kSecond, 20 * kMs));
    sync.push_scan({kStart + 2 * kSecond, {}});
    sync.push_imu(imu_at(kStart + 10 * kSecond));
    const auto groups = take_all(sync);
    EXPECT_EQ(groups[1].end - groups[1].begin, 20 * kMs);
    EXPECT_EQ(groups[2].end - groups[2].begin, 100 * kMs);
}

TEST(Synchronizer, EmptyAndTinyScansPassThrough) {
    Synchronizer sync;
    sync.push_scan(scan_at(kStart, 100 * kMs));
    sync.push_scan({kStart + 100 * kMs, {}});
    sync.push_scan({kStart + 200 * kMs, {point_at(7)}});
    for (Stamp t = 0; t <= 300 * kMs; t += kImuPeriod) sync.push_imu(imu_at(kStart + t));
    const auto groups = take_all(sync);
    ASSERT_EQ(groups.size(), 3U);
    EXPECT_TRUE(groups[1].scan.points.empty());
    EXPECT_EQ(groups[1].end, kStart + 200 * kMs);
    EXPECT_EQ(groups[1].imu.size(), 20U);
}

TEST(Synchronizer, SynchronisedCloudsHaveNoDuration) {
    Synchronizer sync;
    for (int i = 0; i < 3; ++i) sync.push_scan(scan_at(kStart + i * kScanPeriod, 0));
    for (int i = 0; i < 3; ++i) sync.push_imu(imu_at(kStart + i * kScanPeriod));
    const auto groups = take_all(sync);
    ASSERT_EQ(groups.size(), 3U);
    for (const MeasureGroup& group : groups) {
        EXPECT_EQ(group.begin, group.end);
        EXPECT_EQ(group.imu.size(), 1U);
    }
}

TEST(Synchronizer, FinishReleasesScansThatLackOneImuPeriod) {
    Synchronizer sync;
    for (int i = 0; i < 3; ++i) sync.push_scan(scan_at(kStart + i * kScanPeriod));
    for (Stamp t = 0; t <= 195 * kMs; t += kImuPeriod) sync.push_imu(imu_at(kStart + t));
    EXPECT_EQ(take_all(sync).size(), 1U);
    sync.finish();
    const auto rest = take_all(sync);
    ASSERT_EQ(rest.size(), 1U);  // ends 4.9 ms after the last sample
    EXPECT_EQ(rest[0].imu.back().stamp, kStart + 195 * kMs);
    EXPECT_EQ(sync.counts().scans_uncovered, 1U);
    EXPECT_EQ(sync.pending_scans(), 0U);
    EXPECT_EQ(sync.push_imu(imu_at(kStart + kSecond)), PushStatus::kFinished);
    EXPECT_EQ(sync.push_scan(scan_at(kStart + kSecond)), PushStatus::kFinished);
}

TEST(Synchronizer, ImpossibleOptionsAreRefusedByName) {
    const auto refused_key = [](double SynchronizerOptions::*field, double value) {
        SynchronizerOptions options;
        options.*field = value;
        try {
            Synchronizer sync(options);
        } catch (const ConfigError& error) {
            return error.key();
        }
        return std::string("accepted");
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(refused_key(&SynchronizerOptions::rewind_tolerance_s, -1.0),
              "sync.rewind_tolerance_s");
    EXPECT_EQ(refused_key(&SynchronizerOptions::stall_after_s, 0.0), "sync.stall_after_s");
    EXPECT_EQ(refused_key(&SynchronizerOptions::imu_gap_warn_s, nan), "sync.imu_gap_warn_s");
    EXPECT_EQ(refused_key(&SynchronizerOptions::lidar_gap_warn_s, -0.1), "sync.lidar_gap_warn_s");
    EXPECT_EQ(refused_key(&SynchronizerOptions::lidar_gap_warn_s, 0.1), "accepted");
}

}  // namespace
}  // namespace d2lio
