// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>

#include "d2lio/imu/propagation.hpp"
#include "imu_graph.hpp"
#include "imu_graph_sim.hpp"

namespace d2lio::liosam {
namespace {

using test::ImuSim;
using Index = GraphIndex;

constexpr double kDt = 0.001;  // s; the propagation is an Euler scheme
constexpr int kSteps = 100;

/// A matched pose that says nothing.
const Mat6 kBlind = Mat6::Identity() * 1e12;

/// The 15 error states that both describe, as indices into the propagation's 23.
std::array<int, Index::kSize> to_nav() {
    std::array<int, Index::kSize> map{};
    const std::array<int, 5> first = {StateIndex::kRot, StateIndex::kPos, StateIndex::kVel,
                                      StateIndex::kGyroBias, StateIndex::kAccelBias};
    for (int i = 0; i < Index::kSize; ++i) {
        map[static_cast<std::size_t>(i)] = first[static_cast<std::size_t>(i / 3)] + i % 3;
    }
    return map;
}

Mat23x23 to_nav(const Mat15x15& P) {
    const auto map = to_nav();
    Mat23x23 Q = Mat23x23::Zero();
    for (int i = 0; i < Index::kSize; ++i) {
        for (int j = 0; j < Index::kSize; ++j) {
            Q(map[static_cast<std::size_t>(i)], map[static_cast<std::size_t>(j)]) = P(i, j);
        }
    }
    return Q;
}

Mat15x15 from_nav(const Mat23x23& Q) {
    const auto map = to_nav();
    return Mat15x15::NullaryExpr([&](Eigen::Index i, Eigen::Index j) {
        return Q(map[static_cast<std::size_t>(i)], map[static_cast<std::size_t>(j)]);
    });
}

NavState to_nav(const GraphState& s, double gravity) {
    NavState x;
    x.rot = s.T_map_imu.R;
    x.pos = s.T_map_imu.t;
    x.vel = s.vel;
    x.gyro_bias = s.gyro_bias;
    x.accel_bias = s.accel_bias;
    x.gravity = Vec3(0.0, 0.0, -gravity);
    return x;
}

/// Both predictions of one interval from a state that ten scans have settled.
class Prediction : public ::testing::Test {
  protected:
    Prediction() {
        options.prior_bias_sigma = 0.02;
        ImuSim sim(11, options);
        ImuGraph graph(options);
        graph.start(sim.truth.pose, Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
        for (int i = 0; i < 10; ++i) {
            const auto steps = sim.advance(kSteps, kDt);
            graph.correct(sim.measure(test::matcher_covariance()), test::matcher_covariance(),
                          steps);
        }
        x = to_nav(graph.state(), options.gravity);
        P = to_nav(graph.state().covariance);
        const auto steps = sim.advance(kSteps, kDt);
        propagate_over(steps);
        EXPECT_EQ(graph.correct(x.T_map_imu(), kBlind, steps), GraphStatus::kOk);
        predicted = graph.state();
    }

    void propagate_over(const std::vector<ImuStep>& steps) {
        const auto density = [](double n) { return n * n / kDt; };
        // A walk's variance grows by n^2 dt a step, which enters as dt^2 times this.
        const ProcessNoise noise{density(options.gyro_noise), density(options.accel_noise),
                                 density(options.gyro_bias_walk), density(options.accel_bias_walk)};
        for (const ImuStep& s : steps) {
            propagate(x, P, {s.gyro, s.accel}, s.dt, noise.matrix(), true);
        }
        const double variance = options.integration_noise * options.integration_noise;
        P.block<3, 3>(StateIndex::kPos, StateIndex::kPos) +=
            Mat3::Identity() * variance * kSteps * kDt;
    }

    ImuGraphOptions options;
    NavState x;
    Mat23x23 P;
    GraphState predicted;
};

TEST_F(Prediction, StateIsThePropagatedOne) {
    // Half an acceleration times dt^2 a step is what the Euler scheme leaves out.
    constexpr double kPosTolerance = 20.0 * kDt * kDt * kSteps;
    constexpr double kTolerance = 1e-6;
    EXPECT_LT((predicted.T_map_imu.t - x.pos).norm(), kPosTolerance);
    EXPECT_LT(log_so3(predicted.T_map_imu.R.transpose() * x.rot).norm(), kTolerance);
    EXPECT_LT((predicted.vel - x.vel).norm(), kTolerance);
    EXPECT_LT((predicted.gyro_bias - x.gyro_bias).norm(), kTolerance);
    EXPECT_LT((predicted.accel_bias - x.accel_bias).norm(), kTolerance);
}

TEST_F(Prediction, CovarianceIsThePropagatedOneInOrderAndFrames) {
    constexpr double kTolerance = 0.01;  // of the product of two sigmas
    const Mat15x15 expected = from_nav(P);
    const Eigen::Matrix<double, 15, 1> scale = expected.diagonal().cwiseSqrt().cwiseInverse();
    const Mat15x15 difference =
        scale.asDiagonal() * (predicted.covariance - expected) * scale.asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), kTolerance) << difference;
    // The blocks that only a joint marginal has are there to be compared.
    const Mat15x15 correlation = scale.asDiagonal() * expected * scale.asDiagonal();
    const auto strongest = [&](int row, int column) {
        return correlation.block<3, 3>(row, column).cwiseAbs().maxCoeff();
    };
    EXPECT_GT(strongest(Index::kPos, Index::kVel), 0.2);
    EXPECT_GT(strongest(Index::kVel, Index::kRot), 0.2);
    EXPECT_GT(strongest(Index::kRot, Index::kGyroBias), 0.2);
}

}  // namespace
}  // namespace d2lio::liosam
