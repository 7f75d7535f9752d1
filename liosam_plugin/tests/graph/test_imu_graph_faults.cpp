// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>

#include "imu_graph.hpp"
#include "imu_graph_sim.hpp"

namespace d2lio::liosam {
namespace {

using test::ImuSim;
using test::matcher_covariance;

constexpr int kSteps = 20;
constexpr double kDt = 0.005;  // s
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool is_finite(const GraphState& s) {
    return s.T_map_imu.R.allFinite() && s.T_map_imu.t.allFinite() && s.vel.allFinite() &&
           s.gyro_bias.allFinite() && s.accel_bias.allFinite() && s.covariance.allFinite();
}

/// A graph that has run for a while, for a fault to hit.
class ImuGraphFaults : public ::testing::Test {
  protected:
    ImuGraphFaults() : sim(21, options), graph(options) {
        graph.start(sim.truth.pose, Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
        settle();
    }

    GraphStatus scan() {
        const auto steps = sim.advance(kSteps, kDt);
        return graph.correct(sim.measure(P), P, steps);
    }
    /// Three seconds of good scans; afterwards the graph must know its velocity.
    void settle() {
        for (int i = 0; i < 30; ++i) ASSERT_EQ(scan(), GraphStatus::kOk);
        ASSERT_TRUE(is_finite(graph.state()));
        EXPECT_LT((graph.state().vel - sim.truth.vel).norm(), 0.2);
        EXPECT_LT((graph.state().T_map_imu.t - sim.truth.pose.t).norm(), 0.5);
    }
    double speed_sigma() const {
        return std::sqrt(graph.state().covariance.block<3, 3>(GraphIndex::kVel, 6).trace());
    }

    ImuGraphOptions options;
    ImuSim sim;
    ImuGraph graph;
    const Mat6 P = matcher_covariance();
};

TEST_F(ImuGraphFaults, NothingIsDoneBeforeTheStart) {
    ImuGraph fresh;
    EXPECT_EQ(fresh.correct(Pose{}, P, sim.advance(kSteps, kDt)), GraphStatus::kRejected);
    EXPECT_FALSE(fresh.started());
    graph.clear();
    EXPECT_FALSE(graph.started());
    EXPECT_EQ(scan(), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(sim.truth.pose, Vec3::Zero(), Vec3::Zero(), Vec3::Zero()),
              GraphStatus::kOk);
    settle();
}

TEST_F(ImuGraphFaults, StartRefusesWhatIsNotAState) {
    const Vec3 zero = Vec3::Zero(), bad(0.0, kNaN, 0.0);
    Pose mirrored, far;
    mirrored.R(0, 0) = -1.0;
    far.t.x() = 1e200;
    EXPECT_EQ(graph.start({Mat3::Identity(), bad}, zero, zero, zero), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(mirrored, zero, zero, zero), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(far, zero, zero, zero), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(Pose{}, bad, zero, zero), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(Pose{}, zero, bad, zero), GraphStatus::kRejected);
    EXPECT_EQ(graph.start(Pose{}, zero, zero, bad), GraphStatus::kRejected);
    settle();  // the running graph was not touched
}

TEST_F(ImuGraphFaults, StartTakesABiasBeyondItsBoundAsZero) {
    ASSERT_EQ(graph.start(sim.truth.pose, Vec3::Zero(), Vec3(0.0, 0.0, 5.0), Vec3::Zero()),
              GraphStatus::kOk);
    EXPECT_EQ(graph.state().gyro_bias, Vec3(Vec3::Zero()));
    settle();
}

TEST_F(ImuGraphFaults, PoseThatIsNoPoseLeavesAPrediction) {
    const double before = speed_sigma();
    Pose bad = sim.truth.pose;
    bad.R *= 1.1;
    for (const Pose& pose : {Pose{Mat3::Constant(kNaN), Vec3::Zero()}, bad}) {
        const auto steps = sim.advance(kSteps, kDt);
        EXPECT_EQ(graph.correct(pose, P, steps), GraphStatus::kRecovered);
    }
    EXPECT_EQ(graph.counts().bad_poses, 2u);
    EXPECT_GT(speed_sigma(), before);
    EXPECT_LT((graph.state().vel - sim.truth.vel).norm(), 0.2);
    EXPECT_LT((graph.state().T_map_imu.t - sim.truth.pose.t).norm(), 0.5);
    settle();
}

TEST_F(ImuGraphFaults, CovarianceThatIsNoneIsRepaired) {
    Mat6 negative = P;
    negative(3, 3) = -1.0;
    Mat6 asymmetric = P;
    asymmetric(0, 1) = 1.0;
    const Mat6 huge = Mat6::Identity() * 1e300;
    for (const Mat6& C :
         {Mat6(Mat6::Constant(kNaN)), Mat6(Mat6::Zero()), negative, asymmetric, huge}) {
        const auto steps = sim.advance(kSteps, kDt);
        EXPECT_NE(graph.correct(sim.truth.pose, C, steps), GraphStatus::kRejected);
        EXPECT_TRUE(is_finite(graph.state()));
    }
    EXPECT_EQ(graph.counts().bad_covariances, 5u);
    settle();
}

TEST_F(ImuGraphFaults, IntervalWithoutInputsIsBridged) {
    const double before = speed_sigma();
    sim.advance(kSteps, kDt);
    EXPECT_EQ(graph.correct(sim.measure(P), P, {}), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().bridged_intervals, 1u);
    EXPECT_GT(speed_sigma(), before);
    EXPECT_GT(speed_sigma(), 0.1);  // m/s: a tenth of a second without accelerometer
    settle();
}

TEST_F(ImuGraphFaults, StepsWithoutDurationAreSkipped) {
    auto steps = sim.advance(kSteps, kDt);
    ImuStep bad = steps.front();
    for (const double dt : {0.0, -0.005, kNaN, -std::numeric_limits<double>::infinity()}) {
        bad.dt = dt;
        steps.insert(steps.begin() + 3, bad);
    }
    EXPECT_EQ(graph.correct(sim.measure(P), P, steps), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().skipped_steps, 3u);  // an empty one is none of them
    EXPECT_EQ(graph.counts().bridged_intervals, 0u);
    EXPECT_LT((graph.state().vel - sim.truth.vel).norm(), 0.2);
    for (ImuStep& s : steps) s.dt = 0.0;
    sim.advance(kSteps, kDt);
    EXPECT_EQ(graph.correct(sim.measure(P), P, steps), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().bridged_intervals, 1u);
    settle();
}

TEST_F(ImuGraphFaults, InputThatIsNotFiniteIsReplacedByTheOneBefore) {
    auto steps = sim.advance(kSteps, kDt);
    steps.front().gyro.x() = kNaN;
    steps[7].accel.z() = std::numeric_limits<double>::infinity();
    EXPECT_EQ(graph.correct(sim.measure(P), P, steps), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().held_steps, 2u);
    EXPECT_EQ(graph.counts().bridged_intervals, 0u);
    EXPECT_LT((graph.state().vel - sim.truth.vel).norm(), 0.2);
    for (ImuStep& s : steps) s.gyro.x() = kNaN;
    sim.advance(kSteps, kDt);
    EXPECT_EQ(graph.correct(sim.measure(P), P, steps), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().bridged_intervals, 1u);
    settle();
}

TEST_F(ImuGraphFaults, InputHeldTooLongOrTurningTooFarIsBridged) {
    auto steps = sim.advance(kSteps, kDt);
    steps[4].dt = 2.0;
    EXPECT_EQ(graph.correct(sim.measure(P), P, steps), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().bridged_intervals, 1u);
    std::vector<ImuStep> turning(20);
    for (ImuStep& s : turning) {
        s.gyro = Vec3(0.0, 0.0, 64.0);  // 6.4 rad in the interval: a full turn
        s.accel = Vec3(0.0, 0.0, 9.8);
        s.dt = kDt;
    }
    graph.correct(sim.truth.pose, P, turning);
    EXPECT_EQ(graph.counts().bridged_intervals, 2u);
    settle();
}

TEST_F(ImuGraphFaults, AbsurdInputsDoNotSpoilTheGraph) {
    for (const double magnitude : {1e6, 1e30, 1e130, 1e300}) {
        auto steps = sim.advance(kSteps, kDt);
        for (ImuStep& s : steps) s.accel = Vec3::Constant(magnitude);
        EXPECT_NE(graph.correct(sim.measure(P), P, steps), GraphStatus::kRejected);
        EXPECT_TRUE(is_finite(graph.state()));
        EXPECT_LT(graph.state().vel.norm(), options.max_speed);
        steps = sim.advance(kSteps, kDt);
        for (ImuStep& s : steps) s.gyro = Vec3::Constant(magnitude);
        EXPECT_NE(graph.correct(sim.measure(P), P, steps), GraphStatus::kRejected);
        EXPECT_TRUE(is_finite(graph.state()));
    }
    EXPECT_GT(graph.counts().solver_failures, 0u);    // 1e130: squares are finite, their sums not
    EXPECT_GT(graph.counts().bridged_intervals, 0u);  // 1e300: not even these
    for (int i = 0; i < 20; ++i) scan();
    settle();
}

TEST_F(ImuGraphFaults, VanishingIntervalIsNoEquality) {
    std::vector<ImuStep> step(1);
    step[0].accel = Vec3(0.0, 0.0, 9.8);
    step[0].dt = 1e-12;
    EXPECT_EQ(graph.correct(sim.measure(P), P, step), GraphStatus::kOk);
    EXPECT_EQ(graph.counts().bridged_intervals, 1u);
    settle();
}

TEST_F(ImuGraphFaults, JumpOfThePoseResets) {
    Pose far = sim.truth.pose;
    far.t.x() += 1000.0;
    const auto steps = sim.advance(kSteps, kDt);
    const Mat6 sure = Mat6::Identity() * 1e-6;
    EXPECT_EQ(graph.correct(far, sure, steps), GraphStatus::kReset);
    EXPECT_EQ(graph.counts().speed_resets, 1u);
    EXPECT_EQ(graph.state().T_map_imu.t, far.t);
    EXPECT_EQ(graph.state().vel, Vec3(Vec3::Zero()));
    sim.truth.pose.t.x() += 1000.0;
    settle();
}

TEST_F(ImuGraphFaults, HalfATurnOfThePoseResets) {
    sim.truth.pose.R = sim.truth.pose.R * exp_so3(Vec3(0.0, 0.0, 3.141592653589793));
    EXPECT_EQ(scan(), GraphStatus::kReset);
    EXPECT_EQ(graph.counts().jump_resets, 1u);
    settle();
}

// What the matcher does not claim to know is no contradiction.
TEST_F(ImuGraphFaults, LargeResidualWithinItsCovarianceIsNoJump) {
    Mat6 blind = P;
    blind.row(3).setZero();
    blind.col(3).setZero();
    blind(3, 3) = 1e4;
    for (int i = 0; i < 20; ++i) {
        const auto steps = sim.advance(kSteps, kDt);
        EXPECT_EQ(graph.correct(sim.measure(blind), blind, steps), GraphStatus::kOk);
    }
    EXPECT_LT((graph.state().T_map_imu.t - sim.truth.pose.t).norm(), 0.5);
    settle();
}

TEST_F(ImuGraphFaults, BiasBeyondItsBoundResets) {
    options.prior_bias_sigma = 0.2;
    graph = ImuGraph(options);
    graph.start(sim.truth.pose, Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
    GraphStatus status = GraphStatus::kOk;
    for (int i = 0; i < 100 && status == GraphStatus::kOk; ++i) {
        auto steps = sim.advance(kSteps, kDt);
        for (ImuStep& s : steps) s.accel.z() += 3.0;
        status = graph.correct(sim.measure(P), P, steps);
    }
    EXPECT_EQ(status, GraphStatus::kReset);
    EXPECT_EQ(graph.counts().bias_resets, 1u);
    EXPECT_EQ(graph.state().accel_bias, Vec3(Vec3::Zero()));
    settle();
}

// Two matched poses of enormous weight against each other, step after step.
TEST_F(ImuGraphFaults, ContradictoryCertaintiesNeverLeaveTheGraphUnusable) {
    const Mat6 certain = Mat6::Identity() * 1e-30;
    for (int i = 0; i < 50; ++i) {
        const auto steps = sim.advance(kSteps, kDt);
        Pose pose = sim.truth.pose;
        pose.t += sim.normal3(5.0);
        graph.correct(pose, certain, steps);
        ASSERT_TRUE(is_finite(graph.state()));
        ASSERT_TRUE(graph.started());
    }
    graph.start(sim.truth.pose, Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
    settle();
}

}  // namespace
}  // namespace d2lio::liosam
