// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "../geometry/random_state.hpp"
#include "d2lio/degeneracy/noise_share.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-7;       // the floor is 1e-9 of the trace
constexpr double kMonteCarlo = 0.06;  // of a sum of 4000 squares
constexpr double kSigma = 0.03;       // rad, of a fitted normal
constexpr int kRows = 4000;

struct Sums {
    Mat3 information = Mat3::Zero(), noise = Mat3::Zero();
    NoiseShare share() const { return noise_share(information, noise); }
};

/// Noisy normals of a tunnel along `axis`; every one truly leans by +-`lean` along it.
Sums tunnel(test::Random& random, const Vec3& axis, double lean = 0.0) {
    Sums out;
    const Vec3 side = axis.unitOrthogonal();
    for (int i = 0; i < kRows; ++i) {
        const Vec3 round = Eigen::AngleAxisd(random.uniform(0.0, 6.283), axis) * side;
        const Vec3 n = (round + (i % 2 == 0 ? lean : -lean) * axis).normalized();
        const Mat3 C = kSigma * kSigma * (Mat3::Identity() - n * n.transpose());
        const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
        const Vec3 row = n + kSigma * (random.normal() * a + random.normal() * b);
        out.information += row * row.transpose();
        out.noise += C;
    }
    return out;
}

TEST(NoiseShare, IsOneWhereNothingButNoiseWasMeasured) {
    test::Random random(1);
    const Vec3 axis = Vec3(1.0, 0.4, -0.3).normalized();
    const NoiseShare s = tunnel(random, axis).share();
    EXPECT_NEAR(s.share[0], 1.0, kMonteCarlo);
    EXPECT_GT(std::abs(s.axes.col(0).dot(axis)), std::cos(0.01));
    EXPECT_LT(s.share[1], 3.0 * kSigma * kSigma);
    EXPECT_LT(s.share[2], 3.0 * kSigma * kSigma);
}

TEST(NoiseShare, IsThePartOfTheExpectationThatNoiseGives) {
    test::Random random(2);
    for (const double lean : {0.5 * kSigma, kSigma, 3.0 * kSigma}) {
        const double expected = kSigma * kSigma / (kSigma * kSigma + lean * lean);
        EXPECT_NEAR(tunnel(random, Vec3::UnitZ(), lean).share().share[0], expected,
                    2.0 * kMonteCarlo * expected);
    }
}

Mat3 random_spd(test::Random& random) {
    const Mat3 A = Mat3::NullaryExpr([&] { return random.normal(); });
    return A * A.transpose() + 0.1 * Mat3::Identity();
}

TEST(NoiseShare, SolvesTheGeneralisedEigenproblemDescending) {
    test::Random random(3);
    for (int i = 0; i < 50; ++i) {
        const Mat3 L = 100.0 * random_spd(random), N = random_spd(random);
        const NoiseShare s = noise_share(L, N);
        EXPECT_GE(s.share[0], s.share[1]);
        EXPECT_GE(s.share[1], s.share[2]);
        for (int k = 0; k < 3; ++k) {
            const Vec3 d = s.axes.col(k);
            EXPECT_NEAR(d.norm(), 1.0, kExact);
            EXPECT_LT((N * d - s.share[k] * L * d).norm(), kExact * N.norm());
        }
        const Vec3 any = random.vec3(1.0);  // no direction has a larger share
        EXPECT_LE(any.dot(N * any) / any.dot(L * any), s.share[0] * (1.0 + kExact));
    }
}

TEST(NoiseShare, DoesNotChangeWithUnits) {
    test::Random random(4);
    const Mat3 L = 100.0 * random_spd(random), N = random_spd(random);
    const NoiseShare s = noise_share(L, N);
    const NoiseShare all = noise_share(1e4 * L, 1e4 * N);
    EXPECT_LT((all.share - s.share).norm(), kExact * s.share[0]);
    EXPECT_LT((all.axes.cwiseAbs() - s.axes.cwiseAbs()).norm(), 1e3 * kExact);
    const Mat3 T = Vec3(10.0, 1.0, 0.2).asDiagonal();  // each axis in a unit of its own
    const NoiseShare mixed = noise_share(T * L * T, T * N * T);
    EXPECT_LT((mixed.share - s.share).norm(), 1e-4 * s.share[0]);
}

TEST(NoiseShare, ReadsOnlyTheSymmetricPart) {
    test::Random random(5);
    const Mat3 L = 100.0 * random_spd(random), N = random_spd(random);
    Mat3 skew = Mat3::Zero();
    skew(0, 1) = 1.0;
    skew(1, 0) = -1.0;
    const NoiseShare a = noise_share(L, N), b = noise_share(L + skew, N + skew);
    EXPECT_LT((a.share - b.share).norm(), kExact);
}

TEST(NoiseShare, WhatIsNotFiniteHasNone) {
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        Mat3 broken = Mat3::Identity();
        broken(2, 1) = bad;
        EXPECT_EQ(noise_share(broken, Mat3::Identity()).share, Vec3::Zero());
        EXPECT_EQ(noise_share(Mat3::Identity(), broken).share, Vec3::Zero());
    }
}

TEST(NoiseShare, ZeroMatricesAreAnswered) {
    EXPECT_EQ(noise_share(Mat3::Zero(), Mat3::Zero()).share, Vec3::Zero());
    EXPECT_EQ(noise_share(Mat3::Identity(), Mat3::Zero()).share, Vec3::Zero());
    const NoiseShare nothing = noise_share(Mat3::Zero(), Mat3::Identity());
    EXPECT_TRUE(nothing.share.allFinite());
    EXPECT_GT(nothing.share[2], 1.0);  // all of it may be noise
    const Mat3 flat = Vec3(0.0, 5.0, 5.0).asDiagonal();
    const NoiseShare blind = noise_share(flat, 0.01 * Mat3::Identity());
    EXPECT_GT(blind.share[0], 1.0);
    EXPECT_LT(blind.share[1], 0.01);
    EXPECT_NEAR(std::abs(blind.axes(0, 0)), 1.0, kExact);
}

TEST(SmoothStep, RisesFromZeroToOneWithoutACorner) {
    EXPECT_EQ(smooth_step(0.29, 0.3, 0.5), 0.0);
    EXPECT_EQ(smooth_step(0.3, 0.3, 0.5), 0.0);
    EXPECT_EQ(smooth_step(0.5, 0.3, 0.5), 1.0);
    EXPECT_EQ(smooth_step(7.0, 0.3, 0.5), 1.0);
    EXPECT_NEAR(smooth_step(0.4, 0.3, 0.5), 0.5, 1e-12);
    EXPECT_NEAR(smooth_step(0.35, 0.3, 0.5), 0.15625, 1e-12);
    constexpr double kStep = 1e-5;
    double before = 0.0;
    for (double x = 0.25; x < 0.55; x += kStep) {
        const double slope = (smooth_step(x + kStep, 0.3, 0.5) - smooth_step(x, 0.3, 0.5)) / kStep;
        EXPECT_GE(slope, 0.0);
        EXPECT_LT(std::abs(slope - before), 0.01);
        before = slope;
    }
    EXPECT_EQ(smooth_step(std::numeric_limits<double>::quiet_NaN(), 0.3, 0.5), 0.0);
}

}  // namespace
}  // namespace d2lio
