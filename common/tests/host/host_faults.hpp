// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "d2lio/host/intake.hpp"
#include "drive.hpp"

/// The rows of the fault table that reach an estimator, for every host: it must go on, say so, and
/// never show NaN.
namespace d2lio::test {

constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();

/// What a host made of a drive.
struct Outcome {
    std::vector<ScanResult> results;
    HostCounts counts;
    SyncReport sync;

    std::vector<ScanResult> poses() const {
        std::vector<ScanResult> out;
        std::copy_if(results.begin(), results.end(), std::back_inserter(out),
                     [](const ScanResult& r) { return r.has_pose; });
        return out;
    }
    /// Of the last scan with a pose.
    ScanStatus last_status() const {
        const auto all = poses();
        return all.empty() ? ScanStatus::kDropped : all.back().status;
    }
    bool told(const std::string& text) const {
        return std::any_of(results.begin(), results.end(), [&text](const ScanResult& r) {
            return r.message.find(text) != std::string::npos;
        });
    }
};

/// Finite whatever happened; a covariance is symmetric with no negative eigenvalue.
inline void expect_sound(const ScanResult& r) {
    constexpr double kRounding = 1e-9;  // of the largest eigenvalue
    EXPECT_TRUE(r.state.is_finite());
    ASSERT_TRUE(r.covariance.allFinite());
    if (!r.has_pose) return;
    const Eigen::SelfAdjointEigenSolver<Mat6> s(r.covariance);
    const double largest = s.eigenvalues()[5];
    EXPECT_GE(s.eigenvalues()[0], -kRounding * largest);
    EXPECT_LE((r.covariance - r.covariance.transpose()).cwiseAbs().maxCoeff(), kRounding * largest);
    EXPECT_GT(largest, 0.0);
}

template <typename Host>
Outcome observe(Host host, const Drive& drive, SyntheticRoom room = SyntheticRoom()) {
    Outcome out;
    drive.feed(host, room, out.results);
    host.finish();
    step_all(host, out.results);
    out.counts = host.counts();
    out.sync = host.sync_report();
    for (const ScanResult& r : out.results) expect_sound(r);
    return out;
}

/// Seconds since the first stamp of a drive.
inline double since_start(Stamp stamp) { return seconds_between(stamp, SyntheticRoom::kStart); }

/// @tparam Traits of one host: `make(params)` builds it for the room, `kRoomError` (m) is how far
/// it may stray there, `kWithoutPose` how many of 40 scans get no pose.
template <typename Traits>
class HostFaults : public ::testing::Test {
  protected:
    static Outcome run(const Drive& drive, const ParamMap& params = {}) {
        return observe(Traits::make(params), drive);
    }
    static void expect_on_track(const std::vector<ScanResult>& results) {
        EXPECT_LT(largest_error(results, Traits::kWithoutPose), Traits::kRoomError);
    }
};

TYPED_TEST_SUITE_P(HostFaults);

TYPED_TEST_P(HostFaults, NaNInfinityAndZeroReturnsAreDroppedAndCounted) {
    Drive drive;
    drive.edit = [](int, Scan& s) {
        s.points[5].x = kNotANumber;
        s.points[6].y = std::numeric_limits<float>::infinity();
        s.points[7] = LidarPoint{};
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_EQ(r.counts.points.not_finite, 80U);
    EXPECT_EQ(r.counts.points.zero, 40U);
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, EmptyAndTinyScansKeepThePrediction) {
    Drive drive;  // two of each: a host may leave out every second scan
    drive.edit = [](int i, Scan& s) {
        if (i == 20 || i == 21) s.points.clear();
        if (i == 22 || i == 23) s.points.resize(3);
        return true;
    };
    const Outcome r = this->run(drive);
    ASSERT_EQ(r.results.size(), 40U);
    const ScanResult* last = nullptr;
    int damaged = 0;
    for (std::size_t i = 0; i < 30; ++i) {
        if (!r.results[i].has_pose) continue;
        if (i >= 20 && i <= 23) {
            EXPECT_EQ(r.results[i].status, ScanStatus::kTooFewPoints);
            EXPECT_EQ(r.results[i].health, Health::kLost);
            EXPECT_GT(r.results[i].covariance.trace(), last->covariance.trace()) << i;
            ++damaged;
        }
        last = &r.results[i];
    }
    EXPECT_GE(damaged, 2);
    EXPECT_EQ(last->status, ScanStatus::kOk);
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, AllPointsRejectedMeansLostAndAGrowingCovariance) {
    Drive drive;
    drive.scans = 14;
    const auto poses =
        this->run(drive, {{"rejection.mode", "fixed"}, {"rejection.tau", "0"}}).poses();
    ASSERT_GE(poses.size(), 6U);
    EXPECT_EQ(poses.back().status, ScanStatus::kNoCorrespondence);
    EXPECT_EQ(poses.back().health, Health::kLost);
    EXPECT_EQ(poses.back().diagnostics.counts.accepted, 0);
    EXPECT_GT(poses.back().covariance.trace(), poses[2].covariance.trace());
}

TYPED_TEST_P(HostFaults, ABagThatLoopsStartsANewEpoch) {
    SyntheticRoom room;
    auto host = TypeParam::make({});
    std::vector<ScanResult> results;
    Drive drive;
    drive.scans = 20;
    drive.feed(host, room, results);
    const std::size_t first = results.size();
    drive.feed(host, room, results);  // stamps jump back by 2 s
    EXPECT_GE(host.counts().sync.epochs, 1U);
    ASSERT_GT(results.size(), first + 10);
    Outcome second;
    second.results.assign(results.begin() + static_cast<std::ptrdiff_t>(first), results.end());
    EXPECT_TRUE(std::any_of(second.results.begin(), second.results.end(),
                            [](const ScanResult& r) { return r.new_epoch; }));
    EXPECT_EQ(second.last_status(), ScanStatus::kOk);
}

TYPED_TEST_P(HostFaults, DuplicateAndLateSamplesAreSkippedAndCounted) {
    Stamp last = 0;
    Drive drive;
    drive.keep_imu = [&last](ImuSample& s) {
        if (s.stamp % 25'000'000 == 0) s.stamp = last;  // every fifth repeats its predecessor
        last = s.stamp;
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_GT(r.counts.sync.imu_duplicate, 100U);
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, AShortImuGapIsToldAndSurvived) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        return since_start(s.stamp) < 2.0 || since_start(s.stamp) > 2.35;
    };
    const Outcome r = this->run(drive);
    EXPECT_TRUE(r.told("IMU gap"));
    EXPECT_EQ(r.counts.resets, 0U);
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
}

TYPED_TEST_P(HostFaults, ALongLidarGapStartsAnew) {
    Drive drive;
    drive.scans = 60;
    drive.edit = [](int i, Scan&) { return i < 20 || i > 40; };
    const Outcome r = this->run(drive, {{"lidar.gap_reset", "1.5"}});
    EXPECT_EQ(r.counts.resets, 1U);
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
}

TYPED_TEST_P(HostFaults, ALongImuGapStartsAnew) {
    Drive drive;
    drive.scans = 60;
    drive.keep_imu = [](ImuSample& s) {
        return since_start(s.stamp) < 2.0 || since_start(s.stamp) > 4.0;
    };
    const Outcome r = this->run(drive);
    EXPECT_EQ(r.counts.resets, 1U);
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
}

TYPED_TEST_P(HostFaults, ALidarGapIsToldAndSurvived) {
    Drive drive;
    drive.edit = [](int i, Scan&) { return i < 20 || i > 27; };
    const Outcome r = this->run(drive);
    EXPECT_TRUE(r.told("LiDAR gap"));
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, ImuInUnitsOfGIsToldAndScaled) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.accel /= 9.81;
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_TRUE(r.told("the unit is g"));
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, AnImplausibleScaleIsToldAndSurvived) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.accel *= 1.15;
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_TRUE(r.told("wrong unit or scale"));
    EXPECT_EQ(r.last_status(), ScanStatus::kOk);
}

TYPED_TEST_P(HostFaults, ImuWithoutGravityIsRefusedWithAMessage) {
    Drive drive;
    drive.scans = 6;
    drive.keep_imu = [](ImuSample& s) {
        s.accel.setZero();
        return true;
    };
    const Outcome r = this->run(drive);
    ASSERT_FALSE(r.results.empty());
    EXPECT_EQ(r.results.back().status, ScanStatus::kImuFault);
    EXPECT_EQ(r.results.back().health, Health::kInit);
    EXPECT_FALSE(r.results.back().message.empty());
}

TYPED_TEST_P(HostFaults, NaNSamplesAreDroppedAndCounted) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        if (s.stamp % 100'000'000 == 0) s.gyro.x() = kNaN;
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_GT(r.counts.sync.imu_bad, 30U);
    this->expect_on_track(r.results);
}

TYPED_TEST_P(HostFaults, ClocksThatNeverMeetAreNamed) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.stamp -= SyntheticRoom::kStart - 1'000'000'000;  // sensor uptime
        return true;
    };
    const Outcome r = this->run(drive);
    EXPECT_TRUE(r.results.empty());
    EXPECT_EQ(r.sync.health, SyncHealth::kNoOverlap);
}

TYPED_TEST_P(HostFaults, OverloadDropsTheOldestScansAndCountsThem) {
    SyntheticRoom room;
    auto host = TypeParam::make({{"live", "true"}});
    std::vector<ScanResult> results;
    for (int i = 0; i < 40; ++i) {  // a burst: nothing is processed meanwhile
        const Stamp begin = SyntheticRoom::kStart + i * SyntheticRoom::kScanPeriod;
        host.add_scan(room.scan(begin));
        for (Stamp t = 0; t < SyntheticRoom::kScanPeriod; t += SyntheticRoom::kImuPeriod) {
            host.add_imu(room.imu(begin + t));
        }
    }
    step_all(host, results);
    EXPECT_EQ(host.counts().sync.scans_overflow, 35U);
    EXPECT_LE(results.size(), 5U);
}

TYPED_TEST_P(HostFaults, OfflineRunsLoseNothing) {
    SyntheticRoom room;
    auto host = TypeParam::make({});
    std::vector<ScanResult> results;
    const Stamp end = SyntheticRoom::kStart + 40 * SyntheticRoom::kScanPeriod;
    for (Stamp t = SyntheticRoom::kStart; t < end; t += SyntheticRoom::kScanPeriod) {
        host.add_scan(room.scan(t));
    }
    for (Stamp t = SyntheticRoom::kStart; t <= end; t += SyntheticRoom::kImuPeriod) {
        host.add_imu(room.imu(t));
    }
    step_all(host, results);
    EXPECT_EQ(results.size(), 40U);
    this->expect_on_track(results);
}

TYPED_TEST_P(HostFaults, UnsortedPointsAreAccepted) {
    Drive drive;
    std::mt19937 engine(5);
    drive.edit = [&engine](int, Scan& s) {
        std::shuffle(s.points.begin(), s.points.end(), engine);
        return true;
    };
    this->expect_on_track(this->run(drive).results);
}

TYPED_TEST_P(HostFaults, HugeCoordinatesDoNotOverflow) {
    Drive drive;
    drive.edit = [](int i, Scan& s) {
        if (i % 3 == 0) s.points[100].x = 3e7F;
        return true;
    };
    this->expect_on_track(this->run(drive).results);
}

REGISTER_TYPED_TEST_SUITE_P(
    HostFaults, NaNInfinityAndZeroReturnsAreDroppedAndCounted, EmptyAndTinyScansKeepThePrediction,
    AllPointsRejectedMeansLostAndAGrowingCovariance, ABagThatLoopsStartsANewEpoch,
    DuplicateAndLateSamplesAreSkippedAndCounted, AShortImuGapIsToldAndSurvived,
    ALongLidarGapStartsAnew, ALongImuGapStartsAnew, ALidarGapIsToldAndSurvived,
    ImuInUnitsOfGIsToldAndScaled, AnImplausibleScaleIsToldAndSurvived,
    ImuWithoutGravityIsRefusedWithAMessage, NaNSamplesAreDroppedAndCounted,
    ClocksThatNeverMeetAreNamed, OverloadDropsTheOldestScansAndCountsThem, OfflineRunsLoseNothing,
    UnsortedPointsAreAccepted, HugeCoordinatesDoNotOverflow);

}  // namespace d2lio::test
