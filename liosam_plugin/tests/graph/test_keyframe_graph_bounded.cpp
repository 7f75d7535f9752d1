// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "d2lio/geometry/so3.hpp"
#include "keyframe_graph.hpp"

namespace d2lio::liosam {
namespace {

const Pose kStep{exp_so3(Vec3(0.0, 0.0, 0.01)), Vec3::UnitX()};

KeyframeGraphOptions limited(int max_keyframes) {
    KeyframeGraphOptions o;
    o.max_keyframes = max_keyframes;
    return o;
}

TEST(KeyframeGraphBounded, WorkPerKeyframeDoesNotGrow) {
    constexpr std::size_t kKeyframes = 10000, kMaxReeliminated = 4;
    KeyframeGraph graph;
    Pose pose;
    std::size_t most = 0;
    for (std::size_t i = 0; i < kKeyframes; ++i) {
        ASSERT_EQ(graph.add(pose), GraphStatus::kOk);
        most = std::max(most, graph.counts().last_reeliminated);
        pose = pose * kStep;
    }
    EXPECT_LE(most, kMaxReeliminated);
    EXPECT_EQ(graph.size(), kKeyframes);
    EXPECT_LE(graph.size() - graph.first_active(), 5000u);
    EXPECT_EQ(graph.counts().solver_failures, 0u);
    EXPECT_TRUE(graph.covariance().allFinite());
}

TEST(KeyframeGraphBounded, WorkPerKeyframeStaysSmallAfterALoop) {
    KeyframeGraph graph;
    Pose pose;
    for (int i = 0; i < 1000; ++i) {
        graph.add(pose);
        pose = pose * kStep;
    }
    Pose closed = graph.pose(100).inverse() * graph.pose(999);
    closed.t.x() += 1.0;
    ASSERT_EQ(graph.add_loop(100, 999, closed, 1e-3), GraphStatus::kOk);
    EXPECT_GT(graph.counts().last_reeliminated, 900u);  // the loop itself is worth its work
    std::size_t most = 0;
    for (int i = 0; i < 500; ++i) {
        graph.add(graph.pose(graph.size() - 1) * kStep);
        most = std::max(most, graph.counts().last_reeliminated);
    }
    EXPECT_LE(most, 10u);
}

TEST(KeyframeGraphBounded, FullGraphGoesOnWithItsCovarianceAndFreezesTheRest) {
    KeyframeGraph bounded(limited(10)), whole;
    Pose pose;
    for (int i = 0; i < 40; ++i) {
        bounded.add(pose);
        whole.add(pose);
        pose = pose * kStep;
    }
    EXPECT_EQ(bounded.size(), 40u);
    EXPECT_EQ(bounded.counts().restarts, 4u);
    EXPECT_EQ(bounded.first_active(), 36u);
    const auto P = whole.covariance();
    const Vec6 scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Mat6 difference = scale.asDiagonal() * (bounded.covariance() - P) * scale.asDiagonal();
    constexpr double kTolerance = 1e-6;  // of the product of two sigmas
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), kTolerance);
}

TEST(KeyframeGraphBounded, LoopToAFrozenKeyframePullsTheActiveOnes) {
    KeyframeGraph graph(limited(10));
    Pose pose;
    for (int i = 0; i < 35; ++i) {
        graph.add(pose);
        pose = pose * kStep;
    }
    const std::size_t frozen = 3, newest = 34, first = graph.first_active();
    ASSERT_LT(frozen, first);
    const Pose before = graph.pose(frozen);
    Pose relative = before.inverse() * graph.pose(newest);
    relative.t += Vec3(0.0, 0.5, 0.0);
    const Pose expected = before * relative;
    EXPECT_EQ(graph.add_loop(frozen, newest, relative, 1e-6), GraphStatus::kOk);
    EXPECT_LT((graph.pose(newest).t - expected.t).norm(), 1e-3);
    EXPECT_EQ(graph.pose(frozen).t, before.t);
    EXPECT_TRUE(graph.moved());
    // The same said the other way round changes nothing.
    EXPECT_EQ(graph.add_loop(newest, frozen, relative.inverse(), 1e-6), GraphStatus::kOk);
    EXPECT_LT((graph.pose(newest).t - expected.t).norm(), 1e-3);
    EXPECT_EQ(graph.add_loop(1, 2, Pose{}, 1e-4), GraphStatus::kRejected);  // both frozen
}

}  // namespace
}  // namespace d2lio::liosam
