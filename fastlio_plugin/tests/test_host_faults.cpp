// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "fastlio_drive.hpp"
#include "host_faults.hpp"

/// The fault table on the FAST-LIO2 host: the shared suite, then what only this host does.
namespace d2lio::test {
namespace {

struct FastLio2 {
    static fastlio::Host make(const ParamMap& params) { return fastlio::Host(room_params(params)); }
    static constexpr double kRoomError = 0.06;      // m
    static constexpr std::size_t kWithoutPose = 3;  // dropped, start, room for one more
};

INSTANTIATE_TYPED_TEST_SUITE_P(FastLio2, HostFaults, FastLio2);

TEST(FastLio2Faults, AnImuGapLoosensThePrediction) {
    const auto velocity_variance = [](double gap_s) {
        SyntheticRoom room;
        auto host = FastLio2::make({{"imu.gap_warn", "0.05"}});
        std::vector<ScanResult> results;
        Drive drive;
        drive.scans = 22;
        drive.keep_imu = [gap_s](ImuSample& s) {
            return since_start(s.stamp) <= 2.0 || since_start(s.stamp) > 2.0 + gap_s;
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

TEST(FastLio2Faults, AnImplausibleScaleIsNormalised) {
    Drive drive;
    drive.keep_imu = [](ImuSample& s) {
        s.accel *= 1.15;
        return true;
    };
    const Outcome r = observe(FastLio2::make({}), drive);
    EXPECT_LT(largest_error(r.results, FastLio2::kWithoutPose), FastLio2::kRoomError);
}

TEST(FastLio2Faults, TheFullCovarianceStaysSymmetricAndFinite) {
    SyntheticRoom room;
    auto host = FastLio2::make({});
    std::vector<ScanResult> results;
    Drive drive;
    drive.edit = [](int i, Scan& s) {
        if (i % 4 == 3) s.points.clear();
        return true;
    };
    drive.feed(host, room, results);
    const Mat23x23& P = host.covariance();
    ASSERT_TRUE(P.allFinite());
    EXPECT_LT((P - P.transpose()).norm(), 1e-9 * P.norm());
}

}  // namespace
}  // namespace d2lio::test
