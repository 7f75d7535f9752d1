// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "d2lio/config/params.hpp"
#include "d2lio/geometry/so3.hpp"
#include "keyframe_graph.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kHalfPi = 1.5707963267948966;

double distance(const Pose& a, const Pose& b) { return (a.t - b.t).norm(); }
double angle(const Pose& a, const Pose& b) { return log_so3(a.R.transpose() * b.R).norm(); }

/// Keyframes one metre apart around a square of `side` metres, back to the start, with every step
/// turned by `drift` radians too many.
std::vector<Pose> square(int side, double drift) {
    const Pose step{exp_so3(Vec3(0.0, 0.0, drift)), Vec3::UnitX()};
    const Pose corner{exp_so3(Vec3(0.0, 0.0, kHalfPi)), Vec3::Zero()};
    std::vector<Pose> poses{Pose{}};
    for (int i = 0; i < 4 * side; ++i) {
        Pose next = poses.back() * step;
        if ((i + 1) % side == 0) next = next * corner;
        poses.push_back(next);
    }
    return poses;
}

KeyframeGraph graph_of(const std::vector<Pose>& poses, const KeyframeGraphOptions& options = {}) {
    KeyframeGraph graph(options);
    for (const Pose& p : poses) EXPECT_EQ(graph.add(p), GraphStatus::kOk);
    return graph;
}

TEST(KeyframeGraph, ChainKeepsThePosesItWasGiven) {
    const std::vector<Pose> poses = square(10, 0.01);
    KeyframeGraph graph = graph_of(poses);
    ASSERT_EQ(graph.size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
        EXPECT_LT(distance(graph.pose(i), poses[i]), 1e-12);
        EXPECT_LT(angle(graph.pose(i), poses[i]), 1e-12);
    }
    EXPECT_FALSE(graph.moved());
    EXPECT_THROW(graph.pose(poses.size()), std::out_of_range);
}

TEST(KeyframeGraph, LoopPullsADriftedSquareTogether) {
    const std::vector<Pose> truth = square(20, 0.0), drifted = square(20, 0.004);
    KeyframeGraph graph = graph_of(drifted);
    const std::size_t last = drifted.size() - 1;
    const double gap = distance(drifted[last], truth[last]);
    ASSERT_GT(gap, 3.0);  // m
    const Pose closed = truth[0].inverse() * truth[last];
    EXPECT_EQ(graph.add_loop(0, last, closed, 1e-6), GraphStatus::kOk);
    EXPECT_LT(distance(graph.pose(last), truth[last]), 0.02 * gap);
    EXPECT_LT(angle(graph.pose(last), truth[last]), 0.01);
    for (std::size_t i = 0; i <= last; ++i) {  // a constant drift is undone all along the square
        EXPECT_LT(distance(graph.pose(i), truth[i]), 0.1 * gap) << i;
    }
    EXPECT_TRUE(graph.moved());
    EXPECT_FALSE(graph.moved());  // told once
    EXPECT_EQ(graph.counts().loops, 1u);
}

TEST(KeyframeGraph, KeyframesGoOnFromTheCorrectedPose) {
    const std::vector<Pose> truth = square(20, 0.0);
    KeyframeGraph graph = graph_of(square(20, 0.004));
    const std::size_t last = truth.size() - 1;
    graph.add_loop(0, last, truth[0].inverse() * truth[last], 1e-6);
    graph.moved();
    const Pose corrected = graph.pose(last);
    Pose next = corrected;
    for (int i = 0; i < 200; ++i) {
        next = next * Pose{exp_so3(Vec3(0.0, 0.0, 0.05)), Vec3::UnitX()};
        ASSERT_EQ(graph.add(next), GraphStatus::kOk);
        EXPECT_LT(distance(graph.pose(graph.size() - 1), next), 1e-12);
    }
    EXPECT_FALSE(graph.moved());
    EXPECT_LT(distance(graph.pose(last), corrected), 1e-12);
    // A loop that says what is so already moves nothing: the graph holds the poses it shows.
    const std::size_t newest = graph.size() - 1;
    const Pose between = graph.pose(last).inverse() * graph.pose(newest);
    graph.add_loop(last, newest, between, 1e-4);
    EXPECT_LT(distance(graph.pose(newest), next), 1e-2);
    EXPECT_LT(distance(graph.pose(last), corrected), 1e-2);
}

// Along the chain the odometry's variances add up, in the axes of the pose they belong to.
TEST(KeyframeGraph, CovarianceOfTheNewestIsInBodyAndMapAxes) {
    KeyframeGraphOptions o;
    o.prior_tilt_variance = o.prior_yaw_variance = 1e-12;
    o.prior_position_variance = 1e-12;
    o.odometry_rotation_variance = 1e-4;
    o.odometry_translation_variance = 1e-6;
    const Mat3 quarter = exp_so3(Vec3(0.0, 0.0, kHalfPi));
    KeyframeGraph graph = graph_of({{quarter, Vec3::Zero()},
                                    {quarter, quarter * Vec3(5.0, 0.0, 0.0)},
                                    {quarter, quarter * Vec3(15.0, 0.0, 0.0)}},
                                   o);
    const auto P = graph.covariance();
    constexpr double kTolerance = 1e-7;
    EXPECT_NEAR(P(0, 0), 2e-4, kTolerance);
    EXPECT_NEAR(P(2, 2), 2e-4, kTolerance);
    EXPECT_NEAR(P(4, 4), 2e-6, kTolerance);  // along the way, the map's y
    // Across: the first step's rotation acts over the second step's 10 m.
    EXPECT_NEAR(P(3, 3), 2e-6 + 100.0 * 1e-4, kTolerance);
    EXPECT_NEAR(P(5, 5), 2e-6 + 100.0 * 1e-4, kTolerance);
    EXPECT_NEAR(P(2, 3), -10.0 * 1e-4, kTolerance);  // yaw to the left moves towards -x
    EXPECT_LT((P - P.transpose()).norm(), 1e-15);
}

TEST(KeyframeGraph, EmptyAndClearedGraph) {
    KeyframeGraph graph;
    EXPECT_EQ(graph.size(), 0u);
    EXPECT_EQ(graph.covariance().norm(), 0.0);
    EXPECT_EQ(graph.add_loop(0, 1, Pose{}, 1e-4), GraphStatus::kRejected);
    graph = graph_of(square(3, 0.0));
    graph.clear();
    EXPECT_EQ(graph.size(), 0u);
    EXPECT_EQ(graph.covariance().norm(), 0.0);
    EXPECT_EQ(graph.add(Pose{}), GraphStatus::kOk);
    EXPECT_NEAR(graph.covariance()(3, 3), 1e8, 1.0);
}

TEST(KeyframeGraph, InputsThatMeanNothingAreRejected) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const std::vector<Pose> poses = square(3, 0.0);
    KeyframeGraph graph = graph_of(poses);
    Pose stretched, far;
    stretched.R *= 2.0;
    far.t.z() = 1e300;
    std::size_t refused = 0;
    for (const Pose& p : {Pose{Mat3::Identity(), Vec3::Constant(kNaN)}, stretched, far}) {
        EXPECT_EQ(graph.add(p), GraphStatus::kRejected);
        EXPECT_EQ(graph.add_loop(0, 5, p, 1e-4), GraphStatus::kRejected);
        refused += 2;
    }
    for (const double variance : {kNaN, 0.0, -1.0, 1e300}) {
        EXPECT_EQ(graph.add_loop(0, 5, Pose{}, variance), GraphStatus::kRejected);
        ++refused;
    }
    EXPECT_EQ(graph.add_loop(5, 5, Pose{}, 1e-4), GraphStatus::kRejected);
    EXPECT_EQ(graph.add_loop(0, graph.size(), Pose{}, 1e-4), GraphStatus::kRejected);
    EXPECT_EQ(graph.counts().rejected, refused + 2);
    EXPECT_EQ(graph.size(), poses.size());
    EXPECT_FALSE(graph.moved());
}

// A false loop of the highest weight, and one far from it: odd poses, but poses.
TEST(KeyframeGraph, ContradictoryLoopsAreSurvived) {
    KeyframeGraph graph = graph_of(square(20, 0.001));
    const Pose absurd{exp_so3(Vec3(0.0, 3.0, 0.5)), Vec3(1e6, 0.0, 0.0)};
    graph.add_loop(0, 60, absurd, 1e-12);
    graph.add_loop(0, 60, Pose{}, 1e-12);
    graph.add_loop(60, 3, absurd, 1e-12);
    for (std::size_t i = 0; i < graph.size(); ++i) {
        ASSERT_TRUE(graph.pose(i).t.allFinite());
        ASSERT_NEAR(graph.pose(i).R.determinant(), 1.0, 1e-9);
    }
    EXPECT_NE(graph.add(graph.pose(graph.size() - 1) * Pose{Mat3::Identity(), Vec3::UnitX()}),
              GraphStatus::kRejected);
}

TEST(KeyframeGraph, EqualInputsGiveEqualBits) {
    const auto run = [] {
        KeyframeGraph graph = graph_of(square(20, 0.003));
        graph.add_loop(0, 80, Pose{}, 1e-4);
        graph.add_loop(10, 60, Pose{Mat3::Identity(), Vec3(10.0, 20.0, 0.0)}, 1.0);
        return graph;
    };
    KeyframeGraph a = run(), b = run();
    for (std::size_t i = 0; i < a.size(); ++i) {
        ASSERT_EQ(a.pose(i).R, b.pose(i).R);
        ASSERT_EQ(a.pose(i).t, b.pose(i).t);
    }
    EXPECT_EQ(a.covariance(), b.covariance());
}

TEST(KeyframeGraph, InvalidOptionIsRefusedWithItsKey) {
    KeyframeGraphOptions options;
    options.prior_yaw_variance = 0.0;
    try {
        KeyframeGraph graph(options);
        FAIL() << "accepted a zero variance";
    } catch (const ConfigError& e) {
        EXPECT_EQ(e.key(), "keyframe_graph.prior_yaw_variance");
    }
    options = {};
    options.max_keyframes = 1;
    EXPECT_THROW(KeyframeGraph{options}, ConfigError);
}

}  // namespace
}  // namespace d2lio::liosam
