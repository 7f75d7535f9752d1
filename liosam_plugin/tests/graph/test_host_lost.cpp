// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "liosam_drive.hpp"

/// What the host says of itself while scans do not match, and of the prior once they do again.
namespace d2lio::liosam {
namespace {

constexpr int kFirstLost = 20;

/// The drive, with the scans from kFirstLost on, `lost` of them, nowhere near the map.
std::vector<ScanResult> lose(Preset preset, int lost, const ParamMap& params = {}) {
    test::Drive drive;
    drive.scans = kFirstLost + lost + 6;
    drive.edit = [lost](int i, Scan& s) {
        for (LidarPoint& p : s.points) {
            if (i < kFirstLost || i >= kFirstLost + lost) break;
            p.x = p.y = 0.0F;  // a vertical line of points far above
            p.z = 30.0F + static_cast<float>(p.ring);
        }
        return true;
    };
    return test::run(preset, params, 1, drive);
}

/// @returns how many skipped scans had the health `wanted`.
std::size_t expect_health_of_the_last_processed(const std::vector<ScanResult>& results,
                                                Health wanted) {
    Health last = Health::kInit;
    std::size_t skipped = 0;
    for (const ScanResult& r : results) {
        if (r.status == ScanStatus::kSkipped) {
            EXPECT_EQ(r.health, last) << "at " << r.stamp;
            skipped += last == wanted ? 1 : 0;
        }
        last = r.health;
    }
    return skipped;
}

TEST(LioSamHostLost, SkippedScansHaveTheHealthOfTheLastProcessedOne) {
    const auto lost = lose(Preset::kLioSam, 16);
    EXPECT_GE(expect_health_of_the_last_processed(lost, Health::kLost), 5U);
    EXPECT_EQ(lost.back().health, Health::kOk);  // it has recovered by then
    const auto weak = test::run(Preset::kLioSam, {{"degeneracy.weak_share", "0.333"}});
    EXPECT_GE(expect_health_of_the_last_processed(weak, Health::kDegenerate), 5U);
}

TEST(LioSamHostLost, HealthBeginsAnewWithTheEpoch) {
    test::SyntheticRoom room;
    Host host(Preset::kLioSam, test::indoor());
    std::vector<ScanResult> results;
    test::Drive drive;
    drive.scans = 20;
    drive.feed(host, room, results);
    const std::size_t first = results.size();
    ASSERT_EQ(results.back().health, Health::kOk);
    drive.feed(host, room, results);  // stamps jump back
    ASSERT_GT(results.size(), first);
    EXPECT_TRUE(results[first].new_epoch);
    EXPECT_EQ(results[first].health, Health::kInit);
}

struct AfterLoss {
    double variance;     ///< of the last lost position, m^2, summed over the axes
    double information;  ///< of the prior of the first match, m^-2, likewise
    double later;        ///< of the match after that
};

AfterLoss after_loss(int lost) {
    const auto results = lose(Preset::kD2Lio, lost, {{"degeneracy.method", "paper"}});
    const auto first = static_cast<std::size_t>(kFirstLost + lost);
    for (std::size_t i = kFirstLost; i < results.size(); ++i) {
        EXPECT_EQ(results[i].status == ScanStatus::kOk, i >= first) << "scan " << i;
    }
    return {results[first - 1].covariance.topLeftCorner<3, 3>().trace(),
            results[first].diagnostics.prior_t.sum(), results[first + 1].diagnostics.prior_t.sum()};
}

TEST(LioSamHostLost, ThePriorRemembersEveryScanThatDidNotMatch) {
    constexpr double kMostKept = 0.6;   // of the information, where twice as many are lost
    constexpr double kLeastBack = 0.5;  // of a prior that follows a match, one match after the loss
    const double unbroken = after_loss(0).information;
    double last = unbroken;
    for (const int lost : {1, 2, 4, 8, 16}) {
        const AfterLoss after = after_loss(lost);
        EXPECT_LT(after.information, kMostKept * last) << lost << " lost";
        EXPECT_GT(after.later, kLeastBack * unbroken) << lost << " lost";
        last = after.information;
    }
}

TEST(LioSamHostLost, PositionErrorGrowsAtLeastWithTheTimeLost) {
    // The unknown velocity is the same in every lost scan: standard deviations add up, not
    // variances.
    constexpr int kLost = 16;
    EXPECT_GT(after_loss(kLost).variance, kLost * kLost * after_loss(1).variance);
}

}  // namespace
}  // namespace d2lio::liosam
