// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "liosam_drive.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kRoomError = 0.05;  // m, over 4 s with 1 cm range noise

TEST(RunningLioSamHost, ChangesItsModeBetweenScansAndGoesOn) {
    Host host(Preset::kLioSam, test::indoor({{"mappingProcessInterval", "0"}}));
    test::SyntheticRoom room;
    std::vector<ScanResult> results;
    test::Drive().feed(host, room, results);
    EXPECT_TRUE(std::isnan(results.back().diagnostics.sigma));
    host.reconfigure({{"rejection.mode", "kiss"}, {"degeneracy.method", "paper"}});
    test::Drive more;
    more.start = test::SyntheticRoom::kStart + more.scans * test::SyntheticRoom::kScanPeriod;
    more.feed(host, room, results);
    EXPECT_FALSE(std::isnan(results.back().diagnostics.sigma));
    EXPECT_GT(results.back().diagnostics.prior_t.norm(), 0.0);
    EXPECT_EQ(std::count_if(results.begin(), results.end(),
                            [](const ScanResult& r) { return r.new_epoch; }),
              0);
    EXPECT_LT(test::largest_error(results, 2), kRoomError);
}

TEST(RunningLioSamHost, RefusesAChangeAsAWhole) {
    Host host(Preset::kLioSam, test::indoor({{"mappingProcessInterval", "0"}}));
    EXPECT_THROW(host.reconfigure({{"rejection.mode", "kiss"}, {"rejection.tau", "-1"}}),
                 ConfigError);
    EXPECT_THROW(host.reconfigure({{"point_filter_num", "2"}}), ConfigError);
    test::SyntheticRoom room;
    std::vector<ScanResult> results;
    test::Drive().feed(host, room, results);
    EXPECT_TRUE(std::isnan(results.back().diagnostics.sigma));  // not kiss
}

TEST(RunningLioSamHost, TellsWhatBecameOfEveryPoint) {
    Host host(Preset::kLioSam, test::indoor({{"mappingProcessInterval", "0"}}));
    EXPECT_TRUE(host.scan_points().empty());
    test::SyntheticRoom room;
    std::vector<ScanResult> results;
    test::Drive().feed(host, room, results);
    const auto points = host.scan_points();
    const auto verdicts = host.verdicts();
    ASSERT_EQ(points.size(), verdicts.size());
    const auto accepted = std::count(verdicts.begin(), verdicts.end(), Verdict::kAccepted);
    EXPECT_GT(accepted, 0);
    EXPECT_EQ(accepted, results.back().diagnostics.counts.accepted);
}

}  // namespace
}  // namespace d2lio::liosam
