// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <gtsam/nonlinear/factorTesting.h>

#include "imu_graph_state.hpp"
#include "random_state.hpp"

namespace d2lio::liosam {
namespace {

using gtsam::imuBias::ConstantBias;

constexpr double kStep = 1e-6, kTolerance = 1e-6;

gtsam::Pose3 random_pose(d2lio::test::Random& random) {
    return {gtsam::Rot3(random.rotation()), random.vec3(5.0)};
}

Mat15x15 random_covariance(d2lio::test::Random& random) {
    const Mat15x15 A = Mat15x15::NullaryExpr([&] { return random.normal(); });
    return A * A.transpose() + Mat15x15::Identity();
}

bool jacobians_agree(const gtsam::NoiseModelFactor& factor, const gtsam::Values& values) {
    return gtsam::internal::testFactorJacobians("factor", factor, values, kStep, kTolerance);
}

TEST(ImuGraphState, PoseMeasurementJacobianIsNumericallyRight) {
    d2lio::test::Random random(31);
    for (int i = 0; i < 20; ++i) {
        const gtsam::Pose3 measured = random_pose(random);
        const gtsam::Vector6 offset = random.vector(6, 0.8);
        const PoseMeasurement factor(7, measured, random_covariance(random).topLeftCorner<6, 6>());
        gtsam::Values values;
        values.insert(7, measured.retract(offset));
        EXPECT_TRUE(jacobians_agree(factor, values));
    }
}

TEST(ImuGraphState, PriorJacobiansAreNumericallyRight) {
    d2lio::test::Random random(32);
    const StateKeys keys(3);
    for (int i = 0; i < 20; ++i) {
        GraphEstimate mean{random_pose(random), random.vec3(5.0),
                           ConstantBias(random.vec3(0.2), random.vec3(0.02)),
                           random_covariance(random)};
        const StatePrior factor(keys, mean);
        const gtsam::Vector6 offset = random.vector(6, 0.8);
        gtsam::Values values;
        values.insert(keys.pose, mean.pose.retract(offset));
        values.insert(keys.vel, gtsam::Vector3(random.vec3(5.0)));
        values.insert(keys.bias, ConstantBias(random.vec3(0.2), random.vec3(0.02)));
        EXPECT_TRUE(jacobians_agree(factor, values));
    }
}

TEST(ImuGraphState, PriorWeighsByItsCovariance) {
    d2lio::test::Random random(33);
    const StateKeys keys(0);
    GraphEstimate mean{random_pose(random), random.vec3(1.0), ConstantBias(),
                       random_covariance(random)};
    const StatePrior factor(keys, mean);
    const Eigen::VectorXd e = random.vector(GraphIndex::kSize, 0.1);
    gtsam::Values values;
    values.insert(keys.pose, mean.pose.retract(gtsam::Vector6(e.head<6>())));
    values.insert(keys.vel, gtsam::Vector3(mean.vel + e.segment<3>(6)));
    values.insert(keys.bias, ConstantBias(gtsam::Vector6(e.tail<6>())));
    const double expected = 0.5 * e.dot(mean.covariance.ldlt().solve(e));
    EXPECT_NEAR(factor.error(values), expected, 1e-9 * expected);
}

}  // namespace
}  // namespace d2lio::liosam
