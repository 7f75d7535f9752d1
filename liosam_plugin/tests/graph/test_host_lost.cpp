// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "liosam_drive.hpp"

/// What the host says of itself while scans do not match, and of the prior once they do again.
namespace d2lio::liosam {
namespace {

constexpr int kFirstLost = 20;

/// The drive, with the scans from kFirstLost on, `lost` of them, nowhere near the map.
std::vector<ScanResult> lose(Preset preset, int lost) {
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
    return test::run(preset, {}, 1, drive);
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

}  // namespace
}  // namespace d2lio::liosam
