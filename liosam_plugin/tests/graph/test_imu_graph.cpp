// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "d2lio/config/params.hpp"
#include "imu_graph.hpp"
#include "imu_graph_sim.hpp"

namespace d2lio::liosam {
namespace {

using test::ImuSim;
using test::matcher_covariance;
using test::Vec15;

constexpr int kSteps = 20;     // a 10 Hz scan of a 200 Hz IMU
constexpr double kDt = 0.005;  // s

ImuGraphOptions biased_options() {
    ImuGraphOptions o;
    o.prior_bias_sigma = 0.02;  // the simulator draws its biases from this
    return o;
}

/// A graph fed by the simulator, one scan a call.
struct Drive {
    explicit Drive(unsigned seed, const ImuGraphOptions& options = biased_options())
        : sim(seed, options), graph(options) {
        Mat6 prior = Mat6::Identity() * options.prior_pose_sigma * options.prior_pose_sigma;
        graph.start(sim.measure(prior), Vec3::Zero(), Vec3::Zero(), Vec3::Zero());
    }
    GraphStatus scan() {
        const auto steps = sim.advance(kSteps, kDt);
        return graph.correct(sim.measure(matcher_covariance()), matcher_covariance(), steps);
    }
    Vec15 error() const { return sim.error(graph.state()); }

    ImuSim sim;
    ImuGraph graph;
};

double normalised_square(const Vec15& e, const Mat15x15& P, int first, int size) {
    const Eigen::VectorXd part = e.segment(first, size);
    const Eigen::MatrixXd block = P.block(first, first, size, size);
    return part.dot(block.ldlt().solve(part));
}

TEST(ImuGraph, VelocityAndBiasesConverge) {
    Drive run(1);
    for (int i = 0; i < 400; ++i) ASSERT_EQ(run.scan(), GraphStatus::kOk);
    const Vec15 e = run.error();
    EXPECT_LT(e.segment<3>(GraphIndex::kVel).norm(), 0.05);        // m/s
    EXPECT_LT(e.segment<3>(GraphIndex::kGyroBias).norm(), 2e-3);   // rad/s; drawn with 0.02
    EXPECT_LT(e.segment<3>(GraphIndex::kAccelBias).norm(), 8e-3);  // m/s^2; likewise
    EXPECT_LT(e.segment<3>(GraphIndex::kPos).norm(), 0.2);         // m; matched to 0.2 along x
    EXPECT_EQ(run.graph.counts().corrections, 400u);
}

// The mean over the seeds of a chi-square variable with n degrees of freedom, to four of its own
// standard deviations: for the joint error and for every block alone. The matcher is blind along
// one map axis and one body axis, so a covariance in the wrong frame or order fails.
TEST(ImuGraph, CovarianceIsConsistent) {
    constexpr int kSeeds = 40, kScans = 40;
    double joint = 0.0;
    Eigen::Matrix<double, 5, 1> blocks = Eigen::Matrix<double, 5, 1>::Zero();
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
        Drive run(seed);
        for (int i = 0; i < kScans; ++i) ASSERT_EQ(run.scan(), GraphStatus::kOk);
        const Vec15 e = run.error();
        const Mat15x15& P = run.graph.state().covariance;
        joint += normalised_square(e, P, 0, GraphIndex::kSize) / kSeeds;
        for (int b = 0; b < 5; ++b) blocks[b] += normalised_square(e, P, 3 * b, 3) / kSeeds;
    }
    EXPECT_NEAR(joint, 15.0, 4.0 * std::sqrt(2.0 * 15.0 / kSeeds));
    for (int b = 0; b < 5; ++b) {
        EXPECT_NEAR(blocks[b], 3.0, 4.0 * std::sqrt(2.0 * 3.0 / kSeeds)) << "block " << b;
    }
}

// Shrinking onto the joint marginal loses nothing but the freedom to relinearise.
TEST(ImuGraph, ResetIsContinuous) {
    constexpr double kStateTolerance = 0.02;       // of one sigma
    constexpr double kCovarianceTolerance = 0.01;  // of the product of two sigmas
    ImuGraphOptions never = biased_options();
    never.reset_keys = 10000;
    Drive with(3), without(3, never);
    for (int i = 0; i < 120; ++i) {
        with.scan();
        without.scan();
        const Mat15x15& P = without.graph.state().covariance;
        const Vec15 sigma = P.diagonal().cwiseSqrt();
        const Vec15 d = (with.error() - without.error()).cwiseQuotient(sigma);
        EXPECT_LT(d.cwiseAbs().maxCoeff(), kStateTolerance) << "scan " << i;
        const Mat15x15 D = sigma.cwiseInverse().asDiagonal() * (with.graph.state().covariance - P) *
                           sigma.cwiseInverse().asDiagonal();
        EXPECT_LT(D.cwiseAbs().maxCoeff(), kCovarianceTolerance) << "scan " << i;
    }
    EXPECT_EQ(with.graph.counts().marginalisations, 1u);
    EXPECT_EQ(without.graph.counts().marginalisations, 0u);
}

TEST(ImuGraph, StaysConsistentOverManyResets) {
    ImuGraphOptions options = biased_options();
    options.reset_keys = 5;
    constexpr int kSeeds = 20;
    double joint = 0.0;
    for (unsigned seed = 100; seed < 100 + kSeeds; ++seed) {
        Drive run(seed, options);
        for (int i = 0; i < 60; ++i) ASSERT_EQ(run.scan(), GraphStatus::kOk);
        joint +=
            normalised_square(run.error(), run.graph.state().covariance, 0, GraphIndex::kSize) /
            kSeeds;
        EXPECT_GE(run.graph.counts().marginalisations, 14u);
    }
    EXPECT_NEAR(joint, 15.0, 4.0 * std::sqrt(2.0 * 15.0 / kSeeds));
}

// A walk this small is an equality to GTSAM's "smart" noise models.
TEST(ImuGraph, NearlyConstantBiasesKeepTheCovariance) {
    ImuGraphOptions still = biased_options();
    still.accel_bias_walk = still.gyro_bias_walk = 1e-9;
    Drive small(7), least(7, still);
    for (int i = 0; i < 30; ++i) {
        small.scan();
        ASSERT_EQ(least.scan(), GraphStatus::kOk);
    }
    const auto sigma = [](const Drive& d) {
        return Vec15(d.graph.state().covariance.diagonal().cwiseSqrt());
    };
    EXPECT_LT((sigma(least) - sigma(small)).cwiseQuotient(sigma(small)).cwiseAbs().maxCoeff(),
              0.05);
}

TEST(ImuGraph, EqualInputsGiveEqualBits) {
    Drive a(5), b(5);
    for (int i = 0; i < 120; ++i) {
        a.scan();
        b.scan();
        const GraphState &x = a.graph.state(), &y = b.graph.state();
        ASSERT_EQ(x.T_map_imu.R, y.T_map_imu.R);
        ASSERT_EQ(x.T_map_imu.t, y.T_map_imu.t);
        ASSERT_EQ(x.vel, y.vel);
        ASSERT_EQ(x.gyro_bias, y.gyro_bias);
        ASSERT_EQ(x.accel_bias, y.accel_bias);
        ASSERT_EQ(x.covariance, y.covariance);
    }
}

TEST(ImuGraph, InvalidOptionIsRefusedWithItsKey) {
    ImuGraphOptions options;
    options.gyro_noise = -1.0;
    try {
        ImuGraph graph(options);
        FAIL() << "accepted a negative noise";
    } catch (const ConfigError& e) {
        EXPECT_EQ(e.key(), "imu_graph.gyro_noise");
    }
    options = {};
    options.reset_keys = 1;
    EXPECT_THROW(ImuGraph{options}, ConfigError);
    options = {};
    options.max_speed = std::nan("");
    EXPECT_THROW(ImuGraph{options}, ConfigError);
}

}  // namespace
}  // namespace d2lio::liosam
