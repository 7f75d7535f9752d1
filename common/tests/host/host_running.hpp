// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "drive.hpp"

/// What a host that runs must allow, for every host.
namespace d2lio::test {

/// @tparam Traits of one host: `make(params)` builds it for the room with every scan processed
/// and without rejection, `kRoomError` (m) is how far it may stray there, `kWithoutPose` how many
/// scans get no pose.
template <typename Traits>
class RunningHost : public ::testing::Test {};
TYPED_TEST_SUITE_P(RunningHost);

TYPED_TEST_P(RunningHost, ChangesItsModeBetweenScansAndGoesOn) {
    auto host = TypeParam::make();
    SyntheticRoom room;
    std::vector<ScanResult> results;
    Drive().feed(host, room, results);
    EXPECT_TRUE(std::isnan(results.back().diagnostics.sigma));
    host.reconfigure({{"rejection.mode", "kiss"}, {"degeneracy.method", "paper"}});
    Drive more;
    more.start = SyntheticRoom::kStart + more.scans * SyntheticRoom::kScanPeriod;
    more.feed(host, room, results);
    EXPECT_FALSE(std::isnan(results.back().diagnostics.sigma));
    EXPECT_GT(results.back().diagnostics.prior_t.norm(), 0.0);
    EXPECT_EQ(std::count_if(results.begin(), results.end(),
                            [](const ScanResult& r) { return r.new_epoch; }),
              0);
    EXPECT_LT(largest_error(results, TypeParam::kWithoutPose), TypeParam::kRoomError);
}

TYPED_TEST_P(RunningHost, RefusesAChangeAsAWhole) {
    auto host = TypeParam::make();
    EXPECT_THROW(host.reconfigure({{"rejection.mode", "kiss"}, {"rejection.tau", "-1"}}),
                 ConfigError);
    EXPECT_THROW(host.reconfigure({{"point_filter_num", "2"}}), ConfigError);
    SyntheticRoom room;
    std::vector<ScanResult> results;
    Drive().feed(host, room, results);
    EXPECT_TRUE(std::isnan(results.back().diagnostics.sigma));  // not kiss
}

TYPED_TEST_P(RunningHost, TellsWhatBecameOfEveryPoint) {
    auto host = TypeParam::make();
    EXPECT_TRUE(host.scan_points().empty());
    SyntheticRoom room;
    std::vector<ScanResult> results;
    Drive().feed(host, room, results);
    const auto points = host.scan_points();
    const auto verdicts = host.verdicts();
    ASSERT_EQ(points.size(), verdicts.size());
    const auto accepted = std::count(verdicts.begin(), verdicts.end(), Verdict::kAccepted);
    EXPECT_GT(accepted, 0);
    EXPECT_EQ(accepted, results.back().diagnostics.counts.accepted);
}

TYPED_TEST_P(RunningHost, MovesOnWhenARestIsCalledOff) {
    auto host = TypeParam::make({{"degeneracy.method", "noise_aware"}});
    SyntheticRoom room;
    std::vector<ScanResult> results;
    Drive rest;  // two seconds before the first motion, held from the second on
    rest.start = SyntheticRoom::kStart - 15 * SyntheticRoom::kScanPeriod;
    rest.scans = 25;
    rest.feed(host, room, results);
    EXPECT_LT(results.back().state.vel.norm(), 1e-3);
    host.reconfigure({{"degeneracy.rest", "false"}});
    Drive more;
    more.start = rest.start + rest.scans * SyntheticRoom::kScanPeriod;
    more.feed(host, room, results);
    EXPECT_LT(largest_error(results, TypeParam::kWithoutPose), TypeParam::kRoomError);
}

REGISTER_TYPED_TEST_SUITE_P(RunningHost, ChangesItsModeBetweenScansAndGoesOn,
                            RefusesAChangeAsAWhole, MovesOnWhenARestIsCalledOff,
                            TellsWhatBecameOfEveryPoint);

}  // namespace d2lio::test
