// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <limits>

#include "../geometry/random_state.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/imu/hold.hpp"

namespace d2lio {
namespace {

constexpr double kNumeric = 1e-7;  // of an inverse with eigenvalues from 1e-4 to 1e8
using I = StateIndex;

/// 1 mm, 0.1 mrad and 1 mm/s of a body at rest.
Mat23x23 rest_information() {
    Vec23 w = Vec23::Zero();
    w.segment<3>(I::kPos).setConstant(1e6);
    w.segment<3>(I::kRot).setConstant(1e8);
    w.segment<3>(I::kVel).setConstant(1e6);
    return w.asDiagonal();
}

/// Near rest: pose a few millimetres and milliradians off, a few centimetres per second.
NavState near_rest(test::Random& random) {
    NavState x = random.state();
    x.vel = random.vec3(0.05);
    return x;
}

Pose beside(const NavState& x, test::Random& random) {
    return {x.rot * exp_so3(random.vec3(3e-3)), x.pos + random.vec3(5e-3)};
}

TEST(Hold, PosteriorIsTheInformationForm) {
    test::Random random(1);
    for (int i = 0; i < 20; ++i) {
        const NavState before = near_rest(random);
        const Pose rest = beside(before, random);
        const Mat23x23 prior = random.covariance();
        NavState x = before;
        Mat23x23 P = prior;
        hold_still(rest, x, P);
        const Mat23x23 expected = (prior.inverse() + rest_information()).inverse();
        Vec23 error = Vec23::Zero();
        error.segment<3>(I::kPos) = rest.t - before.pos;
        error.segment<3>(I::kRot) = log_so3(before.rot.transpose() * rest.R);
        error.segment<3>(I::kVel) = -before.vel;
        const NavState moved = state_plus(before, expected * rest_information() * error);
        EXPECT_LT((P - expected).norm(), kNumeric * expected.norm());
        EXPECT_LT(state_minus(x, moved).norm(), kNumeric);
        EXPECT_GT(state_minus(x, before).norm(), 1e-3);
    }
}

TEST(Hold, StandsAtTheGivenPoseWithoutVelocity) {
    test::Random random(2);
    NavState x = near_rest(random);
    const Pose rest = beside(x, random);
    Mat23x23 P = Mat23x23::Identity();
    hold_still(rest, x, P);
    EXPECT_LT((x.pos - rest.t).norm(), 1e-6);
    EXPECT_LT(log_so3(rest.R.transpose() * x.rot).norm(), 1e-6);
    EXPECT_LT(x.vel.norm(), 1e-6);
}

TEST(Hold, TeachesTheBiasesWhatTheyAreCorrelatedWith) {
    NavState x;
    x.vel = Vec3(0.01, 0.0, 0.0);  // gained over a second from a bias of 1 cm/s^2
    Mat23x23 P = 1e-6 * Mat23x23::Identity();
    Vec23 grown = Vec23::Zero();
    grown[I::kVel] = 1.0;
    grown[I::kAccelBias] = -1.0;
    P += 1e-2 * grown * grown.transpose();
    hold_still(Pose{}, x, P);
    EXPECT_NEAR(x.accel_bias.x(), 0.01, 1e-4);
    EXPECT_LT(P(I::kAccelBias, I::kAccelBias), 1e-5);
}

TEST(Hold, CovarianceStaysSymmetricAndPositiveOverALongRest) {
    test::Random random(3);
    NavState x = near_rest(random);
    const Pose rest{x.rot, x.pos};
    Mat23x23 P = random.covariance();
    P(I::kPos, I::kPos) += 1e4;
    for (int i = 0; i < 2000; ++i) {
        hold_still(rest, x, P);
        P.diagonal().array() += 1e-9;
    }
    EXPECT_EQ((P - P.transpose()).norm(), 0.0);
    const Eigen::SelfAdjointEigenSolver<Mat23x23> s(P);
    EXPECT_GT(s.eigenvalues()[0], 0.0);
    EXPECT_LT((P.block<3, 3>(I::kPos, I::kPos).trace()), 3.0 * 1e-6);
}

void expect_left_alone(const Pose& rest, const NavState& before, const Mat23x23& prior) {
    NavState x = before;
    Mat23x23 P = prior;
    hold_still(rest, x, P);
    EXPECT_EQ(x.pos, before.pos);
    EXPECT_EQ(x.rot, before.rot);
    EXPECT_EQ(x.vel, before.vel);
    EXPECT_EQ(x.accel_bias, before.accel_bias);
    EXPECT_TRUE((P.array() == prior.array() || (P.array() != P.array())).all());
}

TEST(Hold, WhatCannotBeSolvedIsLeftAlone) {
    test::Random random(4);
    const NavState x = near_rest(random);
    const Pose rest = beside(x, random);
    const Mat23x23 P = random.covariance();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    Pose lost = rest;
    lost.t.x() = nan;
    expect_left_alone(lost, x, P);
    Mat23x23 broken = P;
    broken(I::kVel, I::kVel) = nan;
    expect_left_alone(rest, x, broken);
    Mat23x23 indefinite = P;
    indefinite(I::kRot, I::kRot) = -1.0;
    expect_left_alone(rest, x, indefinite);
    Mat23x23 infinite = P;
    infinite(I::kAccelBias, I::kPos) = std::numeric_limits<double>::infinity();
    infinite(I::kPos, I::kAccelBias) = std::numeric_limits<double>::infinity();
    expect_left_alone(rest, x, infinite);
}

TEST(Hold, ACertainStateStaysWhereItIs) {
    test::Random random(5);
    const NavState before = near_rest(random);
    NavState x = before;
    Mat23x23 P = Mat23x23::Zero();
    hold_still(beside(before, random), x, P);
    EXPECT_LT(state_minus(x, before).norm(), 1e-12);
    EXPECT_EQ(P.norm(), 0.0);
}

TEST(StartCovariance, IsThatOfFastLio2) {
    const Mat23x23 P = start_covariance();
    EXPECT_EQ(P, Mat23x23(P.diagonal().asDiagonal()));
    EXPECT_EQ(P(I::kPos, I::kPos), 1.0);
    EXPECT_EQ(P(I::kVel + 2, I::kVel + 2), 1.0);
    EXPECT_EQ(P(I::kExtrinsicRot, I::kExtrinsicRot), 1e-5);
    EXPECT_EQ(P(I::kExtrinsicPos + 2, I::kExtrinsicPos + 2), 1e-5);
    EXPECT_EQ(P(I::kGyroBias, I::kGyroBias), 1e-4);
    EXPECT_EQ(P(I::kAccelBias, I::kAccelBias), 1e-3);
    EXPECT_EQ(P(I::kGravity + 1, I::kGravity + 1), 1e-5);
}

TEST(Hold, AnAnchoredAttitudeIsKnownAndSharesNothing) {
    test::Random random(7);
    const Mat23x23 before = random.covariance();
    Mat23x23 P = before;
    anchor_attitude(P);
    const Mat3 attitude = P.block<3, 3>(I::kRot, I::kRot);
    EXPECT_EQ((attitude - 1e-6 * Mat3::Identity()).norm(), 0.0);
    EXPECT_EQ(P.middleRows<3>(I::kRot).norm(), attitude.norm());
    EXPECT_EQ(P.middleCols<3>(I::kRot).norm(), attitude.norm());
    EXPECT_EQ((P.bottomRightCorner<17, 17>() - before.bottomRightCorner<17, 17>()).norm(), 0.0);
    EXPECT_EQ((P.topLeftCorner<3, 3>() - before.topLeftCorner<3, 3>()).norm(), 0.0);
}

}  // namespace
}  // namespace d2lio
