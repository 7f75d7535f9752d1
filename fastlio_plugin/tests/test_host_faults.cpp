// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "drive.hpp"

/// The rows of the fault table that reach an estimator: it must go on, say so, and never show NaN.
namespace d2lio::fastlio {
namespace {

using test::Drive;
using test::SyntheticRoom;

constexpr double kRoomError = 0.06;  // m
const float kNotANumber = std::numeric_limits<float>::quiet_NaN();

struct Outcome {
    std::vector<ScanResult> results;
    HostCounts counts;
    SyncReport sync;
};

Outcome run(const Drive& drive, const ParamMap& params = {}) {
    SyntheticRoom room;
    Host host(test::room_params(params));
    Outcome out;
    drive.feed(host, room, out.results);
    host.finish();
    test::step_all(host, out.results);
    out.counts = host.counts();
    out.sync = host.sync_report();
    for (const auto& r : out.results) {
        EXPECT_TRUE(r.state.is_finite());
        EXPECT_TRUE(r.covariance.allFinite());
    }
    return out;
}

TEST(HostFaults, NaNInfinityAndZeroReturnsAreDroppedAndCounted) {
    Drive drive;
    drive.edit = [](int, Scan& s) {
        s.points[5].x = kNotANumber;
        s.points[6].y = std::numeric_limits<float>::infinity();
        s.points[7] = LidarPoint{};
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_EQ(r.counts.points.not_finite, 80U);
    EXPECT_EQ(r.counts.points.zero, 40U);
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, EmptyAndTinyScansKeepThePrediction) {
    Drive drive;
    drive.edit = [](int i, Scan& s) {
        if (i == 20) s.points.clear();
        if (i == 21) s.points.resize(3);
        return true;
    };
    const Outcome r = run(drive);
    ASSERT_EQ(r.results.size(), 40U);
    for (const std::size_t i : {20U, 21U}) {
        EXPECT_EQ(r.results[i].status, ScanStatus::kTooFewPoints);
        EXPECT_EQ(r.results[i].health, Health::kLost);
        EXPECT_GT(r.results[i].covariance.trace(), r.results[i - 1].covariance.trace());
    }
    EXPECT_EQ(r.results[25].status, ScanStatus::kOk);
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, AllPointsRejectedMeansLostAndAGrowingCovariance) {
    Drive drive;
    drive.scans = 12;
    const Outcome r = run(drive, {{"rejection.mode", "fixed"}, {"rejection.tau", "0"}});
    EXPECT_EQ(r.results.back().status, ScanStatus::kNoCorrespondence);
    EXPECT_EQ(r.results.back().health, Health::kLost);
    EXPECT_EQ(r.results.back().diagnostics.counts.accepted, 0);
    EXPECT_GT(r.results[11].covariance.trace(), r.results[5].covariance.trace());
}

TEST(HostFaults, ABagThatLoopsStartsANewEpoch) {
    SyntheticRoom room;
    Host host(test::room_params());
    std::vector<ScanResult> results;
    Drive drive;
    drive.scans = 20;
    drive.feed(host, room, results);
    const std::size_t first = results.size();
    drive.feed(host, room, results);  // stamps jump back by 2 s
    EXPECT_GE(host.counts().sync.epochs, 1U);
    ASSERT_GT(results.size(), first + 10);
    bool flagged = false;
    for (std::size_t i = first; i < results.size(); ++i) flagged |= results[i].new_epoch;
    EXPECT_TRUE(flagged);
    EXPECT_EQ(results.back().status, ScanStatus::kOk);
}

TEST(HostFaults, DuplicateAndLateSamplesAreSkippedAndCounted) {
    Stamp last = 0;
    Drive drive;
    drive.keep_imu = [&last](ImuSample& s) {
        if (s.stamp % 25'000'000 == 0) s.stamp = last;  // every fifth repeats its predecessor
        last = s.stamp;
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_GT(r.counts.sync.imu_duplicate, 100U);
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, AShortImuGapIsToldAndSurvived) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        const double t = seconds_between(s.stamp, SyntheticRoom::kStart);
        return t < 2.0 || t > 2.35;
    };
    const Outcome r = run(drive);
    bool told = false;
    for (const auto& x : r.results) told |= x.message.find("IMU gap") != std::string::npos;
    EXPECT_TRUE(told);
    EXPECT_EQ(r.counts.resets, 0U);
    EXPECT_EQ(r.results.back().status, ScanStatus::kOk);
}

TEST(HostFaults, AnImuGapLoosensThePrediction) {
    const auto velocity_variance = [](double gap_s) {
        SyntheticRoom room;
        Host host(test::room_params({{"imu.gap_warn", "0.05"}}));
        std::vector<ScanResult> results;
        Drive drive;
        drive.scans = 22;
        drive.keep_imu = [gap_s](ImuSample& s) {
            const double t = seconds_between(s.stamp, SyntheticRoom::kStart);
            return t <= 2.0 || t > 2.0 + gap_s;
        };
        drive.edit = [](int i, Scan& s) {  // no points: the pose is the prediction
            if (i >= 20) s.points.resize(2);
            return true;
        };
        drive.feed(host, room, results);
        return host.covariance().block<3, 3>(StateIndex::kVel, StateIndex::kVel).trace();
    };
    EXPECT_GT(velocity_variance(0.15), 2.0 * velocity_variance(0.0));
}

TEST(HostFaults, ALongLidarGapStartsAnew) {
    Drive drive;
    drive.scans = 60;
    drive.edit = [](int i, Scan&) { return i < 20 || i > 40; };
    const Outcome r = run(drive, {{"lidar.gap_reset", "1.5"}});
    EXPECT_EQ(r.counts.resets, 1U);
    EXPECT_EQ(r.results.back().status, ScanStatus::kOk);
}

TEST(HostFaults, ALongImuGapStartsAnew) {
    Drive drive;
    drive.scans = 60;
    drive.keep_imu = [](ImuSample& s) {
        const double t = seconds_between(s.stamp, SyntheticRoom::kStart);
        return t < 2.0 || t > 4.0;
    };
    const Outcome r = run(drive);
    EXPECT_EQ(r.counts.resets, 1U);
    EXPECT_EQ(r.results.back().status, ScanStatus::kOk);
}

TEST(HostFaults, ALidarGapIsToldAndSurvived) {
    Drive drive;
    drive.edit = [](int i, Scan&) { return i < 20 || i > 27; };
    const Outcome r = run(drive);
    bool told = false;
    for (const auto& x : r.results) told |= x.message.find("LiDAR gap") != std::string::npos;
    EXPECT_TRUE(told);
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, ImuInUnitsOfGIsToldAndScaled) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.accel /= 9.81;
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_FALSE(r.results[1].message.empty());
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, AnImplausibleScaleIsToldAndNormalised) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.accel *= 1.15;
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_FALSE(r.results[1].message.empty());
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, ImuWithoutGravityIsRefusedWithAMessage) {
    Drive drive;
    drive.scans = 6;
    drive.keep_imu = [](ImuSample& s) {
        s.accel.setZero();
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_EQ(r.results.back().status, ScanStatus::kImuFault);
    EXPECT_EQ(r.results.back().health, Health::kInit);
    EXPECT_FALSE(r.results.back().message.empty());
}

TEST(HostFaults, NaNSamplesAreDroppedAndCounted) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        if (s.stamp % 100'000'000 == 0) s.gyro.x() = std::numeric_limits<double>::quiet_NaN();
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_GT(r.counts.sync.imu_bad, 30U);
    EXPECT_LT(test::largest_error(r.results), kRoomError);
}

TEST(HostFaults, ClocksThatNeverMeetAreNamed) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.stamp -= SyntheticRoom::kStart - 1'000'000'000;  // sensor uptime
        return true;
    };
    const Outcome r = run(drive);
    EXPECT_TRUE(r.results.empty());
    EXPECT_EQ(r.sync.health, SyncHealth::kNoOverlap);
}

TEST(HostFaults, OverloadDropsTheOldestScansAndCountsThem) {
    SyntheticRoom room;
    Host host(test::room_params({{"live", "true"}}));
    std::vector<ScanResult> results;
    for (int i = 0; i < 40; ++i) {  // a burst: nothing is processed meanwhile
        const Stamp begin = SyntheticRoom::kStart + i * SyntheticRoom::kScanPeriod;
        host.add_scan(room.scan(begin));
        for (Stamp t = 0; t < SyntheticRoom::kScanPeriod; t += SyntheticRoom::kImuPeriod) {
            host.add_imu(room.imu(begin + t));
        }
    }
    test::step_all(host, results);
    EXPECT_EQ(host.counts().sync.scans_overflow, 35U);
    EXPECT_LE(results.size(), 5U);
}

TEST(HostFaults, OfflineRunsLoseNothing) {
    SyntheticRoom room;
    Host host(test::room_params());
    std::vector<ScanResult> results;
    Stamp t = SyntheticRoom::kStart;
    for (int i = 0; i < 40; ++i) {
        host.add_scan(room.scan(SyntheticRoom::kStart + i * SyntheticRoom::kScanPeriod));
    }
    for (; t <= SyntheticRoom::kStart + 40 * SyntheticRoom::kScanPeriod;
         t += SyntheticRoom::kImuPeriod) {
        host.add_imu(room.imu(t));
    }
    test::step_all(host, results);
    EXPECT_EQ(results.size(), 40U);
    EXPECT_LT(test::largest_error(results), kRoomError);
}

TEST(HostFaults, UnsortedPointsAreAccepted) {
    Drive drive;
    std::mt19937 engine(5);
    drive.edit = [&engine](int, Scan& s) {
        std::shuffle(s.points.begin(), s.points.end(), engine);
        return true;
    };
    EXPECT_LT(test::largest_error(run(drive).results), kRoomError);
}

TEST(HostFaults, HugeCoordinatesDoNotOverflow) {
    Drive drive;
    drive.edit = [](int i, Scan& s) {
        if (i % 3 == 0) s.points[100].x = 3e7F;
        return true;
    };
    EXPECT_LT(test::largest_error(run(drive).results), kRoomError);
}

}  // namespace
}  // namespace d2lio::fastlio
