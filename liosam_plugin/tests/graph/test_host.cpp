// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <string>

#include "liosam_drive.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kRoomError = 0.05;  // m, over 4 s with 1 cm range noise
constexpr Preset kPresets[] = {Preset::kLioSam, Preset::kD2Lio};
const char* const kModes[] = {"off", "none", "fixed", "kiss", "point_adaptive"};
const char* const kMethods[] = {"none", "paper", "remap", "tsvd", "xicp"};

/// Scans of a run that get no pose: two start it, and LIO-SAM's interval leaves out every second.
std::size_t without_pose(Preset preset) { return preset == Preset::kLioSam ? 20 : 2; }

TEST(LioSamHost, EveryModeAndMethodFollowsTheTruth) {
    for (const Preset preset : kPresets) {
        for (const char* mode : kModes) {
            for (const char* method : kMethods) {
                const auto results =
                    test::run(preset, {{"rejection.mode", mode}, {"degeneracy.method", method}});
                EXPECT_EQ(results.size(), 40U) << mode << " " << method;
                EXPECT_LT(test::largest_error(results, without_pose(preset)), kRoomError)
                    << mode << " " << method;
            }
        }
    }
}

TEST(LioSamHost, StartsLevelAndMatchesFromTheSecondPose) {
    const auto results = test::run(Preset::kD2Lio);
    EXPECT_EQ(results[0].status, ScanStatus::kInitialising);
    EXPECT_FALSE(results[0].has_pose);
    EXPECT_EQ(results[1].status, ScanStatus::kMapInitialised);
    EXPECT_EQ(results[2].status, ScanStatus::kOk);
    EXPECT_NEAR(results[1].state.rot(2, 2), 1.0, 1e-3);
    EXPECT_NEAR(std::atan2(results[1].state.rot(1, 0), results[1].state.rot(0, 0)), 0.0, 1e-2);
    EXPECT_EQ(results.back().status, ScanStatus::kOk);
    EXPECT_EQ(results.back().health, Health::kOk);
}

TEST(LioSamHost, IntervalSkipsScansButNotTheFirstOnes) {
    const auto results = test::run(Preset::kLioSam);
    std::size_t skipped = 0;
    for (const ScanResult& r : results) {
        skipped += r.status == ScanStatus::kSkipped ? 1 : 0;
        EXPECT_EQ(r.has_pose,
                  r.status == ScanStatus::kOk || r.status == ScanStatus::kMapInitialised);
    }
    EXPECT_GE(skipped, 15U);
    EXPECT_EQ(results[3].status, ScanStatus::kOk);
    const auto all = test::run(Preset::kLioSam, {{"mappingProcessInterval", "0"}});
    EXPECT_LT(test::largest_error(all, 2), kRoomError);
}

bool same(const ScanResult& a, const ScanResult& b) {
    return a.stamp == b.stamp && a.status == b.status && a.state.pos == b.state.pos &&
           a.state.rot == b.state.rot && a.state.vel == b.state.vel &&
           a.covariance == b.covariance && a.state.accel_bias == b.state.accel_bias;
}

TEST(LioSamHost, ResultsDoNotDependOnTheThreadCountAndRepeat) {
    for (const Preset preset : kPresets) {
        const auto one = test::run(preset, {}, 1), two = test::run(preset, {}, 2),
                   again = test::run(preset, {}, 2);
        ASSERT_EQ(one.size(), two.size());
        for (std::size_t i = 0; i < one.size(); ++i) {
            EXPECT_TRUE(same(one[i], two[i])) << "scan " << i;
            EXPECT_TRUE(same(two[i], again[i])) << "scan " << i;
        }
    }
}

TEST(LioSamHost, CovarianceIsSymmetricPositiveDefinite) {
    for (const auto& r : test::run(Preset::kD2Lio)) {
        if (!r.has_pose) continue;
        EXPECT_LT((r.covariance - r.covariance.transpose()).norm(), 1e-15);
        const Eigen::SelfAdjointEigenSolver<Mat6> s(r.covariance);
        EXPECT_GT(s.eigenvalues()[0], 0.0);
    }
}

TEST(LioSamHost, EstimatesTheVelocity) {
    const auto results = test::run(Preset::kD2Lio);
    const ScanResult& first = results[1];
    const ScanResult& last = results.back();
    const auto truth = [](const ScanResult& r, double offset) {
        return test::SyntheticRoom::pose(seconds_between(r.stamp, test::SyntheticRoom::kStart) +
                                         offset);
    };
    const Vec3 v_world = (truth(last, 1e-3).t - truth(last, -1e-3).t) / 2e-3;
    const Mat3 world_to_map = first.state.rot * truth(first, 0.0).R.transpose();
    EXPECT_LT((last.state.vel - world_to_map * v_world).norm(), 0.1);
    EXPECT_GT(last.state.vel.norm(), 0.2);
}

TEST(LioSamHost, NineAxisOrientationLevelsTheStart) {
    // The whole world leans by 0.2 rad as the IMU's own attitude tells it: the map follows that.
    const Mat3 lean = exp_so3(Vec3(0.2, 0, 0));
    test::Drive drive;
    drive.keep_imu = [&lean](ImuSample& s) {
        const double t = seconds_between(s.stamp, test::SyntheticRoom::kStart);
        const Eigen::Quaterniond q(lean * test::SyntheticRoom::pose(t).R);
        s.orientation = q.coeffs();
        return true;
    };
    const auto with = test::run(Preset::kD2Lio, {}, 1, drive);
    EXPECT_NEAR(with[1].state.rot(2, 1), std::sin(0.2), 2e-3);
    const auto without = test::run(Preset::kD2Lio, {{"imu.use_orientation", "false"}}, 1, drive);
    EXPECT_NEAR(without[1].state.rot(2, 1), 0.0, 2e-3);
}

TEST(LioSamHost, MapAndMemoryStayBoundedAtStandstill) {
    Host host(Preset::kD2Lio, test::indoor());
    test::SyntheticRoom room;
    std::size_t early = 0;
    Stamp imu = test::SyntheticRoom::kStart;
    const Scan still = room.scan(test::SyntheticRoom::kStart);
    const ImuSample rest = room.imu(test::SyntheticRoom::kStart);
    for (int i = 0; i < 300; ++i) {
        Scan scan = still;
        scan.stamp += i * test::SyntheticRoom::kScanPeriod;
        const Stamp end = scan.stamp + test::SyntheticRoom::kScanPeriod;
        host.add_scan(std::move(scan));
        for (; imu <= end; imu += test::SyntheticRoom::kImuPeriod) {
            ImuSample s = rest;
            s.stamp = imu;
            s.gyro += 1e-3 * Vec3::Random();
            s.accel += 1e-2 * Vec3::Random();
            host.add_imu(s);
        }
        while (host.step()) {
        }
        if (i == 50) early = host.map_bytes();
    }
    EXPECT_LE(host.map_bytes(), early + early / 10);
    EXPECT_GT(early, 0U);
}

TEST(LioSamHost, LoopsAreClosedAndKeepTheTrajectoryTrue) {
    const ParamMap params = test::indoor({{"loopClosureEnableFlag", "true"},
                                          {"historyKeyframeSearchTimeDiff", "3"},
                                          {"surroundingkeyframeAddingDistThreshold", "0.2"},
                                          {"historyKeyframeSearchNum", "5"}});
    test::Drive drive;
    drive.scans = 100;
    const auto drive_through = [&](std::size_t& loops) {
        Host host(Preset::kD2Lio, params);
        test::SyntheticRoom room;
        std::vector<ScanResult> results;
        drive.feed(host, room, results);
        for (const auto& [name, count] : host.counts().own) {
            if (std::string(name) == "loops") loops = count;
        }
        return results;
    };
    std::size_t first = 0, second = 0;
    const auto results = drive_through(first), again = drive_through(second);
    EXPECT_GT(first, 0U);
    EXPECT_LT(test::largest_error(results, 3), kRoomError);
    ASSERT_EQ(results.size(), again.size());
    for (std::size_t i = 0; i < results.size(); ++i) EXPECT_TRUE(same(results[i], again[i]));
}

TEST(LioSamHost, BareKeysAreRefusedByName) {
    const auto refusal = [](const ParamMap& params) -> std::string {
        try {
            Host host(Preset::kLioSam, params);
            return "";
        } catch (const ConfigError& e) {
            return e.key();
        }
    };
    EXPECT_EQ(refusal({{"N_SCANS", "16"}}), "N_SCANS");
    EXPECT_EQ(refusal({{"N_SCAN", "0"}}), "N_SCAN");
    EXPECT_EQ(refusal({{"mappingSurfLeafSize", "nan"}}), "mappingSurfLeafSize");
    EXPECT_EQ(refusal({{"front_end", "indirect"}}), "front_end");
    EXPECT_EQ(refusal({{"rejection.tau", "-1"}}), "rejection.tau");
    EXPECT_EQ(refusal({{"mapping.extrinsic_R", "1 0 0 0 1 0 0 0 -1"}}), "mapping.extrinsic_R");
    EXPECT_EQ(refusal({{"imuGravity", "1"}}), "imuGravity");
    EXPECT_EQ(refusal({}), "");
}

TEST(LioSamHost, PresetsDifferInTheirDefaultsOnly) {
    const auto values = [](Preset preset) {
        std::map<std::string, std::string> out;
        for (const ParamInfo& p : Host::describe(preset)) {
            EXPECT_TRUE(out.emplace(p.key, p.default_value).second) << p.key;
            EXPECT_FALSE(p.doc.empty()) << p.key;
        }
        return out;
    };
    auto liosam = values(Preset::kLioSam), d2lio = values(Preset::kD2Lio);
    EXPECT_EQ(liosam.size(), d2lio.size());
    EXPECT_EQ(liosam["front_end"], "features");
    EXPECT_EQ(d2lio["front_end"], "direct");
    EXPECT_EQ(liosam["rejection.mode"], "off");
    EXPECT_EQ(d2lio["rejection.mode"], "point_adaptive");
    EXPECT_EQ(d2lio["degeneracy.method"], "noise_aware");
    EXPECT_EQ(liosam["mappingProcessInterval"], "0.15");
}

}  // namespace
}  // namespace d2lio::liosam
