// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "../geometry/random_state.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/host/rest_start.hpp"
#include "d2lio/imu/hold.hpp"

namespace d2lio {
namespace {

using Event = RestStart::Event;

constexpr float kMillimetre = 1e-3F;
constexpr int kSamples = 20;                             // of a scan of 0.1 s
constexpr double kPeriod = 0.005;                        // s
constexpr double kGyroNoise = 2e-3, kAccelNoise = 3e-2;  // rad/s, m/s^2
const Vec3 kAccelBias(0.1, -0.05, 0.2);                  // m/s^2
constexpr int kProbation = 10;                           // scans of a second

/// A scan that sees nothing along x.
ScanDiagnostics blind_along_x() {
    ScanDiagnostics d;
    d.v_t = Mat3::Identity();
    d.noise_share = Vec3(0.9, 0.02, 0.01);
    return d;
}

NavState start() {
    NavState x;
    x.rot = exp_so3(Vec3(0.1, 0.2, 0.3));
    x.pos = Vec3(1.0, 2.0, 3.0);
    x.gravity = Vec3(0.0, 0.0, -9.81);
    return x;
}

Pose moved(const Vec3& by, const Vec3& turn = Vec3::Zero()) {
    return {start().rot * exp_so3(turn), start().pos + by};
}

/// A run that begins at rest, scan by scan.
struct Drive {
    RestStart rest;
    ScanDiagnostics scan = blind_along_x();
    test::Random random{1};
    double shaking = 1.0;  ///< of the accelerometer, by its noise

    Drive() {
        feed();
        rest.begin(start(), start_covariance());
    }
    Vec3 noise(double sigma) {
        return sigma * Vec3(random.normal(), random.normal(), random.normal());
    }
    void feed(const Vec3& accel = Vec3::Zero()) {
        std::vector<ImuSample> samples(kSamples);
        std::vector<ImuStep> steps(kSamples);
        const Vec3 force = start().rot.transpose() * -start().gravity + kAccelBias;
        for (std::size_t i = 0; i < samples.size(); ++i) {
            samples[i].gyro = steps[i].gyro = noise(kGyroNoise);
            samples[i].accel = steps[i].accel = force + accel + noise(shaking * kAccelNoise);
            steps[i].dt = kPeriod;
        }
        rest.watch(samples);
        rest.record(steps);
    }
    Event step(const Pose& estimate = moved(Vec3::Zero()), const Vec3& accel = Vec3::Zero()) {
        feed(accel);
        return rest.judge(estimate, scan);
    }
    /// Steps until something happens. @returns how many that took.
    int until(Event event, const Pose& estimate, int most = 30) {
        for (int i = 1; i <= most; ++i) {
            if (step(estimate) == event) return i;
        }
        return 0;
    }
};

TEST(RestStart, IsBelievedAfterASecond) {
    Drive run;
    EXPECT_TRUE(run.rest.watched());
    EXPECT_FALSE(run.rest.noise(1.0).has_value());
    EXPECT_EQ(run.until(Event::kConfirmed, moved(Vec3::Zero())), kProbation);
    EXPECT_TRUE(run.rest.held());
    EXPECT_FALSE(run.rest.watched());
    ASSERT_TRUE(run.rest.noise(1.0).has_value());
    EXPECT_NEAR(run.rest.noise(1.0)->accel, 4.0 * kAccelNoise * kAccelNoise,
                kAccelNoise * kAccelNoise);
}

TEST(RestStart, AnEstimateThatLeavesWithinTheSecondMakesItARunInMotion) {
    for (const Vec3& by : {Vec3(0.0, -0.051, 0.0), Vec3(3.0, 0.0, 0.051)}) {
        Drive run;
        EXPECT_EQ(run.step(moved(by)), Event::kNothing);
        EXPECT_FALSE(run.rest.watched());
        EXPECT_EQ(run.until(Event::kConfirmed, moved(Vec3::Zero())), 0) << "for good";
        EXPECT_FALSE(run.rest.noise(1.0).has_value()) << "what was measured is not rest's";
    }
}

TEST(RestStart, IsLeftOnlyWhereTheScanCanSee) {
    for (const Vec3& by : {Vec3(3.0, 0.0, 0.0), Vec3(0.0, -0.049, 0.0)}) {
        Drive run;
        EXPECT_EQ(run.until(Event::kConfirmed, moved(by)), kProbation);
    }
    Drive turned, almost;
    EXPECT_EQ(turned.until(Event::kConfirmed, moved(Vec3::Zero(), Vec3(0.0, 0.0, -0.011))), 0);
    EXPECT_EQ(almost.until(Event::kConfirmed, moved(Vec3::Zero(), Vec3(0.0, 0.0, 0.009))),
              kProbation);
}

TEST(RestStart, AScanThatSaysNothingSeesNoMotion) {
    Drive run;
    run.scan = ScanDiagnostics{};
    EXPECT_EQ(run.until(Event::kConfirmed, moved(Vec3(1.0, 1.0, 1.0))), kProbation);
}

TEST(RestStart, WhatTheImuFeelsEndsIt) {
    Drive early, late, shaken;
    EXPECT_EQ(early.step(moved(Vec3::Zero()), Vec3(0.0, 0.3, 0.0)), Event::kNothing);
    EXPECT_EQ(early.until(Event::kConfirmed, moved(Vec3::Zero())), 0);
    ASSERT_GT(late.until(Event::kConfirmed, moved(Vec3::Zero())), 0);
    EXPECT_EQ(late.step(moved(Vec3::Zero()), Vec3(0.0, 0.3, 0.0)), Event::kNothing);
    EXPECT_FALSE(late.rest.held());
    EXPECT_TRUE(late.rest.noise(1.0).has_value()) << "that rest was one";
    shaken.shaking = 10.0;  // a drive on a road
    EXPECT_EQ(shaken.until(Event::kConfirmed, moved(Vec3::Zero())), 0);
}

TEST(RestStart, AScanContradictsARestThatIsHeld) {
    Drive run;
    ASSERT_GT(run.until(Event::kConfirmed, moved(Vec3::Zero())), 0);
    EXPECT_EQ(run.step(moved(Vec3(0.0, 0.06, 0.0))), Event::kContradicted);
    EXPECT_FALSE(run.rest.held());
    Mat23x23 P = Mat23x23::Zero();
    reopen(P);
    EXPECT_EQ(P(StateIndex::kVel, StateIndex::kVel), 0.25);
}

TEST(RestStart, TheReplayTeachesTheBiasAndStaysWhereItBegan) {
    Drive run;
    ASSERT_GT(run.until(Event::kConfirmed, moved(Vec3::Zero())), 0);
    NavState x;
    Mat23x23 P;
    run.rest.replay(1.0, true, x, P);
    EXPECT_LT((x.pos - start().pos).norm(), 1e-3);
    EXPECT_LT(x.vel.norm(), 1e-2);
    // What is felt at rest, bias and tilt together, is known to the white noise of a second.
    const Vec3 felt =
        x.rot * (start().rot.transpose() * -start().gravity + kAccelBias - x.accel_bias) +
        x.gravity;
    EXPECT_LT(felt.norm(), 4.0 * kAccelNoise / std::sqrt(kProbation * kSamples));
    EXPECT_LT(P(StateIndex::kVel, StateIndex::kVel), 1e-5);
}

TEST(RestStart, NothingIsWatchedThatDidNotBegin) {
    RestStart rest;
    EXPECT_EQ(rest.judge(moved(Vec3(1.0, 1.0, 1.0)), blind_along_x()), Event::kNothing);
    EXPECT_FALSE(rest.watched() || rest.held());
    rest.end();
    rest.begin(start(), start_covariance());
    EXPECT_FALSE(rest.watched()) << "it moved before the map began";
    rest.reset();
    rest.begin(start(), start_covariance());
    EXPECT_TRUE(rest.watched());
}

TEST(RestCloud, IsTheMeanOfUpToFiftyScans) {
    RestCloud cloud;
    for (int i = 0; i < 50; ++i) {
        cloud.add({{0.2F, 0.2F, i % 2 == 0 ? 0.3F : 0.1F}});
    }
    cloud.add({{0.2F, 0.2F, 90.0F}});
    const auto mean = cloud.mean(0.5);
    ASSERT_EQ(mean.size(), 1U);
    EXPECT_NEAR(mean[0].z(), 0.2F, kMillimetre);
}

TEST(RestCloud, KeepsVoxelsApartAndBeginsAnew) {
    RestCloud cloud;
    cloud.add({{0.2F, 0.2F, 0.1F}, {5.2F, 0.2F, 0.1F}});
    EXPECT_EQ(cloud.mean(0.5).size(), 2U);
    cloud.clear();
    EXPECT_TRUE(cloud.mean(0.5).empty());
    cloud.add({{1.2F, 0.2F, 0.1F}});
    EXPECT_EQ(cloud.mean(0.5).size(), 1U);
}

TEST(RestCloud, IsTakenLessAndLessOften) {
    RestCloud cloud;
    int taken = 0;
    for (int i = 0; i < 60; ++i) {
        cloud.add({{0.2F, 0.2F, 0.1F}});
        if (!cloud.grown()) continue;
        ++taken;
        cloud.mean(0.5);
    }
    EXPECT_GT(taken, 8);
    EXPECT_LT(taken, 16);
    EXPECT_FALSE(cloud.grown());
}

}  // namespace
}  // namespace d2lio
