// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "../geometry/numeric_jacobian.hpp"
#include "../geometry/random_state.hpp"
#include "d2lio/imu/propagation.hpp"

namespace d2lio {
namespace {

constexpr double kNumeric = 2e-7;  // of central differences with step 1e-6
constexpr double kDt = 0.02;       // s, long enough that second-order terms would show

ImuInput random_input(test::Random& random) { return {random.vec3(2.0), random.vec3(12.0)}; }

TEST(Propagation, StateJacobianMatchesDifferences) {
    test::Random random(1);
    for (int i = 0; i < 20; ++i) {
        const NavState x = random.state();
        const ImuInput u = random_input(random);
        const NavState y = propagate_state(x, u, kDt);
        const auto f = [&](const Eigen::VectorXd& e) -> Eigen::VectorXd {
            return state_minus(propagate_state(state_plus(x, Vec23(e)), u, kDt), y);
        };
        const Eigen::MatrixXd J = test::numeric_jacobian(f, Vec23::Zero());
        EXPECT_LT((J - propagation_jacobian(x, u, kDt, true)).norm(), kNumeric);
    }
}

TEST(Propagation, NoiseJacobianMatchesDifferences) {
    test::Random random(2);
    for (int i = 0; i < 20; ++i) {
        const NavState x = random.state();
        const ImuInput u = random_input(random);
        const NavState y = propagate_state(x, u, kDt);
        // The measured value is the true one plus noise, so the error moves against the noise; the
        // biases' noise is a rate added to them.
        const auto f = [&](const Eigen::VectorXd& n) -> Eigen::VectorXd {
            ImuInput v = u;
            v.gyro -= n.segment<3>(0);
            v.accel -= n.segment<3>(3);
            NavState z = propagate_state(x, v, kDt);
            z.gyro_bias += n.segment<3>(6) * kDt;
            z.accel_bias += n.segment<3>(9) * kDt;
            return state_minus(z, y);
        };
        const Eigen::MatrixXd J = test::numeric_jacobian(f, Eigen::VectorXd::Zero(12));
        EXPECT_LT((J - kDt * propagation_noise_jacobian(x, u, kDt)).norm(), kNumeric);
    }
}

TEST(Propagation, UpstreamJacobianLacksOnlyTheRotationBlock) {
    test::Random random(3);
    const NavState x = random.state();
    const ImuInput u = random_input(random);
    Mat23x23 gap = propagation_jacobian(x, u, kDt, true) - propagation_jacobian(x, u, kDt, false);
    EXPECT_GT(gap.norm(), 1e-3);
    gap.block<3, 3>(StateIndex::kRot, StateIndex::kRot).setZero();
    EXPECT_EQ(gap.norm(), 0.0);
}

TEST(Propagation, CovarianceStaysSymmetricPositiveDefiniteAndGrows) {
    test::Random random(4);
    NavState x = random.state();
    Mat23x23 P = random.covariance();
    const double before = P.topLeftCorner<3, 3>().trace();
    const Mat12 Q = ProcessNoise().matrix();
    for (int i = 0; i < 400; ++i) propagate(x, P, random_input(random), 0.005, Q, false);
    EXPECT_EQ((P - P.transpose()).norm(), 0.0);
    EXPECT_EQ(Eigen::LLT<Mat23x23>(P).info(), Eigen::Success);
    EXPECT_GT((P.topLeftCorner<3, 3>().trace()), before);
    EXPECT_LT((x.rot * x.rot.transpose() - Mat3::Identity()).norm(), 1e-12);
}

TEST(Propagation, ConstantInputAtRestKeepsTheState) {
    NavState x;
    x.gravity = Vec3(0, 0, -9.809);
    const ImuInput u{Vec3::Zero(), Vec3(0, 0, 9.809)};
    const NavState y = propagate_state(x, u, 1.0);
    EXPECT_LT(state_minus(y, x).norm(), 1e-12);
}

}  // namespace
}  // namespace d2lio
