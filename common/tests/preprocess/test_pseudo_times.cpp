// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "d2lio/preprocess/pseudo_times.hpp"

namespace d2lio {
namespace {

constexpr double kPeriod = 0.1;
constexpr double kPi = 3.14159265358979323846;
constexpr int kRings = 16, kColumns = 900;
constexpr double kToleranceNs = 2e3;  // float32 coordinates

LidarPoint at(double azimuth, int ring) {
    LidarPoint p;
    p.x = static_cast<float>(10.0 * std::cos(azimuth));
    p.y = static_cast<float>(10.0 * std::sin(azimuth));
    p.z = static_cast<float>(ring);
    p.ring = static_cast<std::uint16_t>(ring);
    return p;
}

double true_azimuth(int column, int sense) {
    return 1.0 + sense * 2.0 * kPi * column / static_cast<double>(kColumns);
}

double true_ns(int column) { return 1e9 * kPeriod * column / static_cast<double>(kColumns); }

TEST(PseudoTimes, ColumnOrderBothSenses) {
    for (const int sense : {1, -1}) {
        std::vector<LidarPoint> points;
        for (int c = 0; c < kColumns; ++c) {
            for (int r = 0; r < kRings; ++r) points.push_back(at(true_azimuth(c, sense), r));
        }
        std::vector<std::int32_t> dt;
        ASSERT_TRUE(pseudo_times_by_azimuth(points, kPeriod, dt));
        for (std::size_t i = 0; i < points.size(); ++i) {
            ASSERT_NEAR(dt[i], true_ns(static_cast<int>(i) / kRings), kToleranceNs) << sense;
        }
    }
}

TEST(PseudoTimes, RingOrderWithMissingReturns) {
    std::vector<LidarPoint> points;
    std::vector<double> expected;
    for (int r = 0; r < kRings; ++r) {
        for (int c = r * 40; c < kColumns; ++c) {  // upper rings begin in the sky
            if (c % 7 == r % 7) continue;
            points.push_back(at(true_azimuth(c, 1), r));
            expected.push_back(true_ns(c));
        }
    }
    std::vector<std::int32_t> dt;
    ASSERT_TRUE(pseudo_times_by_azimuth(points, kPeriod, dt));
    for (std::size_t i = 0; i < points.size(); ++i) {
        ASSERT_NEAR(dt[i], expected[i] - expected[0], kToleranceNs);
    }
}

TEST(PseudoTimes, MoreThanAFullTurnGoesOn) {
    std::vector<LidarPoint> points;
    const int columns = kColumns + 20;
    for (int c = 0; c < columns; ++c) points.push_back(at(true_azimuth(c, -1), 0));
    std::vector<std::int32_t> dt;
    ASSERT_TRUE(pseudo_times_by_azimuth(points, kPeriod, dt));
    EXPECT_NEAR(dt.back(), true_ns(columns - 1), kToleranceNs);
}

TEST(PseudoTimes, BeamsThatLeadTheFirstReturnStartBeforeIt) {
    constexpr double kLead = 0.02;  // rad
    std::vector<LidarPoint> points;
    for (int c = 0; c < kColumns; ++c) {
        points.push_back(at(true_azimuth(c, 1), 0));
        points.push_back(at(true_azimuth(c, 1) - kLead, 1));
    }
    std::vector<std::int32_t> dt;
    ASSERT_TRUE(pseudo_times_by_azimuth(points, kPeriod, dt));
    EXPECT_EQ(dt[1], 0);
    EXPECT_NEAR(dt[0], 1e9 * kPeriod * kLead / (2.0 * kPi), kToleranceNs);
}

TEST(PseudoTimes, JitterAtTheStartIsNotAFullTurn) {
    constexpr double kJitter = 0.01;  // rad
    std::vector<LidarPoint> points{at(1.0, 0), at(1.0 - kJitter, 0)};
    for (int c = 2; c < kColumns; ++c) points.push_back(at(true_azimuth(c, 1), 0));
    std::vector<std::int32_t> dt;
    ASSERT_TRUE(pseudo_times_by_azimuth(points, kPeriod, dt));
    EXPECT_EQ(dt[1], 0);
    EXPECT_NEAR(dt[0], 1e9 * kPeriod * kJitter / (2.0 * kPi), kToleranceNs);
}

TEST(PseudoTimes, NoDirectionNoTimes) {
    std::vector<std::int32_t> dt{1, 2, 3};
    EXPECT_FALSE(pseudo_times_by_azimuth({}, kPeriod, dt));
    EXPECT_TRUE(dt.empty());
    LidarPoint nan;
    nan.x = std::numeric_limits<float>::quiet_NaN();
    EXPECT_FALSE(pseudo_times_by_azimuth({LidarPoint{}, nan, at(1.0, 0)}, kPeriod, dt));
    EXPECT_EQ(dt, (std::vector<std::int32_t>{0, 0, 0}));
}

}  // namespace
}  // namespace d2lio
