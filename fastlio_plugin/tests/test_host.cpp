// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <map>

#include "fastlio_drive.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kRoomError = 0.05;  // m, over 4 s with 1 cm range noise

const char* const kModes[] = {"off", "none", "fixed", "kiss", "point_adaptive"};
const char* const kMethods[] = {"none", "paper", "remap", "tsvd", "xicp", "noise_aware"};

bool same(const ScanResult& a, const ScanResult& b) {
    return a.stamp == b.stamp && a.status == b.status && a.state.pos == b.state.pos &&
           a.state.rot == b.state.rot && a.state.vel == b.state.vel &&
           a.covariance == b.covariance &&
           a.diagnostics.counts.accepted == b.diagnostics.counts.accepted;
}

TEST(Host, EveryModeAndMethodFollowsTheTruth) {
    for (const char* mode : kModes) {
        for (const char* method : kMethods) {
            const auto results =
                test::run({{"rejection.mode", mode}, {"degeneracy.method", method}});
            EXPECT_EQ(results.size(), 40U) << mode << " " << method;
            EXPECT_LT(test::largest_error(results), kRoomError) << mode << " " << method;
            EXPECT_EQ(results.back().status, ScanStatus::kOk);
        }
    }
}

TEST(Host, StartsAsFastLio2Does) {
    const auto results = test::run();
    EXPECT_EQ(results[0].status, ScanStatus::kDropped);
    EXPECT_EQ(results[1].status, ScanStatus::kInitialising);
    EXPECT_EQ(results[2].status, ScanStatus::kMapInitialised);
    EXPECT_EQ(results[3].status, ScanStatus::kOk);
    EXPECT_FALSE(results[1].has_pose);
    EXPECT_TRUE(results[2].has_pose);
}

TEST(Host, EstimatesTheExtrinsicOnline) {
    const auto results = test::run({{"mapping.extrinsic_est_en", "true"}});
    EXPECT_LT(test::largest_error(results), kRoomError);
    const Pose truth = test::SyntheticRoom::T_imu_lidar();
    EXPECT_LT((results.back().state.extrinsic_pos - truth.t).norm(), 0.02);
    EXPECT_NE(results.back().state.extrinsic_pos, truth.t);
}

TEST(Host, ResultsDoNotDependOnTheThreadCountAndRepeat) {
    std::vector<ParamMap> runs{{{"degeneracy.method", "noise_aware"}}};
    for (const char* mode : kModes) {
        runs.push_back({{"rejection.mode", mode}, {"degeneracy.method", "paper"}});
    }
    for (const ParamMap& params : runs) {
        const std::string mode = params.begin()->second + " " + params.rbegin()->second;
        const auto one = test::run(params, 1), two = test::run(params, 2),
                   again = test::run(params, 2);
        ASSERT_EQ(one.size(), two.size());
        for (std::size_t i = 0; i < one.size(); ++i) {
            EXPECT_TRUE(same(one[i], two[i])) << mode << " scan " << i;
            EXPECT_TRUE(same(two[i], again[i])) << mode << " scan " << i;
        }
    }
}

TEST(Host, CovarianceIsSymmetricPositiveDefiniteAndOfThisScan) {
    for (const auto& r : test::run()) {
        if (r.status != ScanStatus::kOk) continue;
        EXPECT_LT((r.covariance - r.covariance.transpose()).norm(), 1e-15);
        const Eigen::SelfAdjointEigenSolver<Mat6> s(r.covariance);
        EXPECT_GT(s.eigenvalues()[0], 0.0);
    }
}

TEST(Host, CovarianceIsInRosOrderAndMapAxes) {
    test::Random random(1);
    NavState x = random.state();
    const Mat23x23 P = random.covariance();
    const auto C = pose_covariance(x, P);
    EXPECT_EQ((C.topLeftCorner<3, 3>()), (P.topLeftCorner<3, 3>()));
    const Mat3 expected = x.rot * P.block<3, 3>(3, 3) * x.rot.transpose();
    EXPECT_LT((C.bottomRightCorner<3, 3>() - expected).norm(), 1e-15);
}

TEST(Host, CovarianceIsWiderAlongTheWeakDirection) {
    test::SyntheticRoom tube;
    tube.half = Vec3(500.0, 4.6, 1.35);  // no end in sight: x is weak
    Host host(test::room_params({{"preprocess.max_range", "40"}}));
    std::vector<ScanResult> results;
    test::Drive{}.feed(host, tube, results);
    const ScanResult& r = results.back();
    ASSERT_EQ(r.health, Health::kDegenerate);
    const Vec3 v = r.diagnostics.v_t.col(0);
    EXPECT_GT(std::abs(v.x()), std::cos(2.0 * 3.14159 / 180.0));
    const Mat3 C = r.covariance.topLeftCorner<3, 3>();
    EXPECT_GT(v.dot(C * v), 10.0 * (C.trace() - v.dot(C * v)) / 2.0);
}

TEST(Host, MapStaysBoundedAtStandstill) {
    test::SyntheticRoom room;
    Host host(test::room_params());
    std::vector<ScanResult> results;
    test::Drive drive;
    drive.scans = 10;  // the first second stands still
    drive.feed(host, room, results);
    const std::size_t early = results.back().map_points;
    for (int round = 1; round < 20; ++round) {  // shift the same second on, again and again
        for (Stamp t = 0; t < 10 * test::SyntheticRoom::kScanPeriod;
             t += test::SyntheticRoom::kScanPeriod) {
            Scan scan = room.scan(test::SyntheticRoom::kStart + t);
            const Stamp shift = round * 10 * test::SyntheticRoom::kScanPeriod;
            scan.stamp += shift;
            for (Stamp i = 0; i < test::SyntheticRoom::kScanPeriod;
                 i += test::SyntheticRoom::kImuPeriod) {
                ImuSample s = room.imu(test::SyntheticRoom::kStart + (t + i) % 900'000'000);
                s.stamp = scan.stamp + i + test::SyntheticRoom::kImuPeriod;
                host.add_imu(s);
            }
            host.add_scan(std::move(scan));
            test::step_all(host, results);
        }
    }
    EXPECT_GT(results.size(), 190U);
    EXPECT_LT(results.back().map_points, early + early / 2);
    EXPECT_LT(host.map_bytes(), 4U << 20U);
}

TEST(HostConfig, RefusesWhatCannotWork) {
    const auto refused = [](const ParamMap& params, const std::string& key, int threads = 1) {
        try {
            Host host(params, threads);
            ADD_FAILURE() << key << " was accepted";
        } catch (const ConfigError& e) {
            EXPECT_EQ(e.key(), key);
            EXPECT_FALSE(e.allowed().empty());
        }
    };
    refused({{"rejection.mod", "off"}}, "rejection.mod");
    refused({{"rejection.mode", "fancy"}}, "rejection.mode");
    refused({{"rejection.tau", "-1"}}, "rejection.tau");
    refused({{"filter_size_map", "nan"}}, "filter_size_map");
    refused({{"filter_size_surf", "0"}}, "filter_size_surf");
    refused({{"max_iteration", "0"}}, "max_iteration");
    refused({{"preprocess.blind", "10"}, {"preprocess.max_range", "5"}}, "preprocess.max_range");
    refused({{"mapping.extrinsic_R", "1 0 0 0 1 0 0 0 -1"}}, "mapping.extrinsic_R");
    refused({{"degeneracy.w", "inf"}}, "degeneracy.w");
    refused({{"degeneracy.share_low", "1000"}}, "parameters");
    refused({{"imu.gap_reset", "0"}}, "imu.gap_reset");
    refused({{"rejection.mode", "point_adaptive"},
             {"rejection.motion", "deviation"},
             {"rejection.epsilon_0", "0"}},
            "parameters");
    refused({}, "threads", 0);
}

TEST(HostConfig, ExtrinsicErrorGivesTheDeterminant) {
    try {
        Host host(ParamMap{{"mapping.extrinsic_R", "1 0 0 0 1 0 0 0 -1"}});
        FAIL();
    } catch (const ConfigError& e) {
        EXPECT_NE(std::string(e.what()).find("-1"), std::string::npos) << e.what();
    }
}

TEST(HostConfig, DescribesEveryKeyOnce) {
    std::map<std::string, int> keys;
    for (const auto& p : Host::describe()) {
        ++keys[p.key];
        EXPECT_FALSE(p.doc.empty()) << p.key;
        EXPECT_NO_THROW(Host(ParamMap{{p.key, p.default_value}})) << p.key;
    }
    for (const auto& [key, count] : keys) EXPECT_EQ(count, 1) << key;
    EXPECT_TRUE(keys.count("rejection.mode") == 1 && keys.count("filter_size_map") == 1);
}

}  // namespace
}  // namespace d2lio::fastlio
