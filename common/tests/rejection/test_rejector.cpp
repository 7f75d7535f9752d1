// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/rejection/rejector.hpp"

namespace d2lio {
namespace {

constexpr double kVoxel = 0.5;
constexpr double kExact = 1e-12;
const double kInfinity = std::numeric_limits<double>::infinity();

Rejector make(RejectionMode mode) {
    RejectionConfig config;
    config.mode = mode;
    return {config, kVoxel};
}

Pose motion(double translation, double angle) {
    return {exp_so3(Vec3(0, 0, angle)), Vec3(translation, 0, 0)};
}

TEST(Rejector, OffAndNoneNeverReject) {
    for (const auto mode : {RejectionMode::kOff, RejectionMode::kNone}) {
        Rejector r = make(mode);
        r.begin_scan(motion(1.0, 0.1));
        EXPECT_EQ(r.threshold(10.0), kInfinity);
    }
}

TEST(Rejector, OnlyOffKeepsTheHostGatesByDefault) {
    EXPECT_TRUE(make(RejectionMode::kOff).host_gates());
    EXPECT_FALSE(make(RejectionMode::kNone).host_gates());
    EXPECT_FALSE(make(RejectionMode::kPointAdaptive).host_gates());
    RejectionConfig config;
    config.mode = RejectionMode::kFixed;
    config.keep_host_gate = true;
    EXPECT_TRUE(Rejector(config, kVoxel).host_gates());
}

TEST(Rejector, FixedIgnoresRangeAndMotion) {
    Rejector r = make(RejectionMode::kFixed);
    r.begin_scan(motion(30.0, 1.0));
    EXPECT_EQ(r.threshold(0.0), 2.0);
    EXPECT_EQ(r.threshold(200.0), 2.0);
}

TEST(Rejector, PointAdaptiveFollowsThePaper) {
    Rejector r = make(RejectionMode::kPointAdaptive);
    r.begin_scan(motion(0.7, 0.2));
    for (const double range : {0.0, 1.0, 25.0}) {
        const double paper = 0.7 + 2.0 * range * std::sin(0.1);
        EXPECT_NEAR(r.threshold(range), paper + kVoxel, kExact);
    }
}

TEST(Rejector, LiteralPaperRejectsAllAtStandstill) {
    RejectionConfig config;
    config.mode = RejectionMode::kPointAdaptive;
    config.epsilon_0 = 0.0;
    Rejector r(config, kVoxel);
    r.begin_scan(motion(0.0, 0.0));
    EXPECT_EQ(r.threshold(50.0), 0.0);
}

TEST(Rejector, PointAdaptiveMayFollowTheDeviation) {
    RejectionConfig config;
    config.mode = RejectionMode::kPointAdaptive;
    config.motion = PointAdaptiveRejection::Motion::kDeviation;
    Rejector r(config, kVoxel);
    r.begin_scan(motion(5.0, 1.0));
    EXPECT_EQ(r.threshold(10.0), kVoxel);
    r.end_scan(motion(0.3, 0.0));
    r.begin_scan(motion(5.0, 1.0));
    EXPECT_NEAR(r.threshold(10.0), 0.3 + kVoxel, kExact);
}

TEST(Rejector, KissIsTheRunningMeanOfLargeDeviations) {
    Rejector r = make(RejectionMode::kKiss);
    EXPECT_NEAR(r.threshold(0.0), 6.0, kExact);
    r.end_scan(motion(0.05, 0.0));  // below delta_min: does not count
    EXPECT_NEAR(r.sigma(), 2.0, kExact);
    r.end_scan(motion(0.4, 0.001));
    const double delta = 0.4 + 2.0 * 100.0 * std::sin(0.0005);
    EXPECT_NEAR(r.sigma(), std::sqrt((4.0 + delta * delta) / 2.0), 1e-9);
}

TEST(Rejector, SigmaIsNaNInOtherModes) {
    EXPECT_TRUE(std::isnan(make(RejectionMode::kFixed).sigma()));
}

TEST(RejectionConfig, BindsItsKeys) {
    RejectionConfig config;
    ParamTable table;
    config.bind(table);
    table.set("rejection.mode", "kiss");
    table.set("rejection.epsilon_0", "0.25");
    EXPECT_EQ(config.mode, RejectionMode::kKiss);
    EXPECT_EQ(config.epsilon_0, 0.25);
    table.set("rejection.epsilon_0", "auto");
    EXPECT_FALSE(config.epsilon_0.has_value());
    EXPECT_THROW(table.set("rejection.mode", "kis"), ConfigError);
    EXPECT_THROW(table.set("rejection.tau", "-1"), ConfigError);
    EXPECT_THROW(table.set("rejection.sigma_0", "0"), ConfigError);
}

}  // namespace
}  // namespace d2lio
