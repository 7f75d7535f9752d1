// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <limits>

#include "../geometry/numeric_jacobian.hpp"
#include "../geometry/random_state.hpp"
#include "d2lio/degeneracy/prior.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-10;
constexpr double kNumeric = 1e-7;

Mat3 random_spd(test::Random& random, double scale) {
    const Mat3 A = Mat3::NullaryExpr([&] { return random.normal(); });
    return scale * (A * A.transpose() + 0.05 * Mat3::Identity());
}

Spectrum random_spectrum(test::Random& random) {
    return {decompose(random_spd(random, 900.0)), decompose(random_spd(random, 300.0))};
}

double smallest_eigenvalue(const Mat3& M) {
    return Eigen::SelfAdjointEigenSolver<Mat3>(M).eigenvalues()[0];
}

TEST(Spectrum, RebuildsTheBlockAscending) {
    test::Random random(1);
    for (int i = 0; i < 50; ++i) {
        const Mat3 M = random_spd(random, 400.0);
        const BlockSpectrum s = decompose(M);
        EXPECT_LT((s.apply([](double l) { return l; }) - M).norm(), kExact * M.norm());
        EXPECT_LE(s.lambda[0], s.lambda[1]);
        EXPECT_LE(s.lambda[1], s.lambda[2]);
        for (int c = 0; c < 3; ++c) EXPECT_GT(s.v.col(c).maxCoeff(), 0.57);
    }
}

TEST(Spectrum, SurvivesEmptyAndNonFiniteBlocks) {
    EXPECT_EQ(decompose(Mat3::Zero()).lambda.norm(), 0.0);
    EXPECT_EQ(decompose(Mat3::Zero()).weak_count(0.03), 3);
    const Mat3 bad = Mat3::Constant(std::numeric_limits<double>::quiet_NaN());
    EXPECT_EQ(decompose(bad).v, Mat3::Identity());
}

TEST(Spectrum, NamesTheTunnelAxis) {
    // Normals of a tube along a tilted axis, with the noise that fitted normals have.
    test::Random random(2);
    const Vec3 axis = Vec3(1.0, 0.3, -0.1).normalized();
    const Vec3 side = axis.unitOrthogonal();
    Mat3 information = Mat3::Zero();
    for (int i = 0; i < 3000; ++i) {
        const Vec3 n = Eigen::AngleAxisd(random.uniform(0, 6.28), axis) * side;
        const Vec3 noisy = (n + 0.05 * random.normal() * axis).normalized();
        information += noisy * noisy.transpose();
    }
    const BlockSpectrum s = decompose(information);
    EXPECT_EQ(s.weak_count(0.03), 1);
    EXPECT_GT(std::abs(s.v.col(0).dot(axis)), std::cos(0.5 * 3.14159 / 180.0));
}

TEST(PaperPrior, CongruenceIsPositiveDefiniteAndEqualsTheProductWhenTheyCommute) {
    test::Random random(3);
    const PaperPrior prior{PaperPrior::Form::kCongruence, 2.0, 1e-9};
    for (int i = 0; i < 50; ++i) {
        const Spectrum s = random_spectrum(random);
        const PriorTerm t = prior.evaluate(s, random_spd(random, 1e-4), random_spd(random, 1e-3));
        EXPECT_TRUE(t.adds_prior);
        EXPECT_GT(smallest_eigenvalue(t.W_t), 0.0);
        EXPECT_GT(smallest_eigenvalue(t.W_r), 0.0);
    }
    const Spectrum s = random_spectrum(random);
    const Mat3 information = s.translation.apply([](double l) { return l; });
    const Mat3 P = 0.01 * Mat3::Identity();
    const PriorTerm t = prior.evaluate(s, P, P);
    EXPECT_LT((t.W_t - 2.0 * (information * P).inverse()).norm(), kExact * t.W_t.norm());
}

TEST(PaperPrior, LiteralFormIsTheClippedSymmetricPart) {
    test::Random random(4);
    const PaperPrior prior{PaperPrior::Form::kPaper, 1.0, 1e-9};
    int clipped = 0;
    for (int i = 0; i < 200; ++i) {
        const Spectrum s = random_spectrum(random);
        const Mat3 P = random_spd(random, 1e-3);
        const Mat3 W = (s.translation.apply([](double l) { return l; }) * P).inverse();
        const Mat3 symmetric = 0.5 * (W + W.transpose());
        const Mat3 got = prior.evaluate(s, P, P).W_t;
        EXPECT_GE(smallest_eigenvalue(got), -kExact * got.norm());
        if (smallest_eigenvalue(symmetric) > 0.0) {
            EXPECT_LT((got - symmetric).norm(), 1e-7 * got.norm());
        } else {
            ++clipped;
        }
    }
    EXPECT_GT(clipped, 0);  // the trap is real: the symmetric part is not always positive
}

TEST(PaperPrior, WeighsInverselyWithLambdaAndClampsIt) {
    Spectrum s;
    s.translation.lambda = Vec3(0.0, 10.0, 1000.0);
    s.rotation = s.translation;
    const Mat3 P = 0.04 * Mat3::Identity();
    const PriorTerm t = PaperPrior{}.evaluate(s, P, P);
    EXPECT_NEAR(t.W_t(0, 0), 30.0 / 0.04, 1e-6);  // lambda clamped to 1
    EXPECT_NEAR(t.W_t(1, 1), 30.0 / 0.04 / 10.0, 1e-6);
    EXPECT_NEAR(t.W_t(2, 2), 30.0 / 0.04 / 1000.0, 1e-6);
}

TEST(PaperPrior, StaysFiniteWithSingularCovariance) {
    Spectrum s;
    for (const auto form : {PaperPrior::Form::kCongruence, PaperPrior::Form::kPaper}) {
        const PriorTerm t = PaperPrior{form, 1.0, 1.0}.evaluate(s, Mat3::Zero(), Mat3::Zero());
        EXPECT_TRUE(t.W_r.allFinite());
        EXPECT_TRUE(t.W_t.allFinite());
    }
}

TEST(RemapPrior, RemovesOnlyDirectionsBelowTheThreshold) {
    test::Random random(5);
    Spectrum s = random_spectrum(random);
    s.translation.lambda = Vec3(10.0, 390.0, 450.0);
    s.rotation.lambda = Vec3(500.0, 600.0, 700.0);
    const PriorTerm t = RemapPrior{}.evaluate(s, Mat3::Identity(), Mat3::Identity());
    EXPECT_TRUE(t.projects);
    EXPECT_FALSE(t.adds_prior);
    EXPECT_LT((t.keep_t * s.translation.v.col(0)).norm(), kExact);
    EXPECT_LT((t.keep_t * s.translation.v.col(1) - s.translation.v.col(1)).norm(), kExact);
    EXPECT_LT((t.keep_r - Mat3::Identity()).norm(), kExact);
    s.translation.lambda[0] = 101.0;
    EXPECT_FALSE(RemapPrior{}.evaluate(s, Mat3::Identity(), Mat3::Identity()).projects);
}

TEST(PriorRows, NormalEquationsEqualTheInformationForm) {
    test::Random random(6);
    for (int i = 0; i < 50; ++i) {
        PriorTerm prior;
        prior.W_r = random_spd(random, 1e4);
        prior.W_t = random_spd(random, 1e3);
        const Vec3 e_r = random.vec3(0.05);
        const Vec3 e_t = random.vec3(0.2);
        const double variance = 0.001;
        const PriorRows rows = make_prior_rows(prior, e_r, e_t, variance);
        ASSERT_EQ(rows.count, 6);
        Mat6 A;
        A << rows.rotation, rows.translation;
        Mat6 J = Mat6::Identity();
        J.topLeftCorner<3, 3>() = right_jacobian_inverse_so3(e_r);
        Mat6 W = Mat6::Zero();
        W.topLeftCorner<3, 3>() = prior.W_r;
        W.bottomRightCorner<3, 3>() = prior.W_t;
        Eigen::Matrix<double, 6, 1> e;
        e << e_r, e_t;
        const Mat6 expected = J.transpose() * W * J;
        const Eigen::Matrix<double, 6, 1> gradient = -J.transpose() * W * e;
        EXPECT_LT((A.transpose() * A / variance - expected).norm(), kExact * expected.norm());
        EXPECT_LT((A.transpose() * rows.residual / variance - gradient).norm(),
                  kExact * (1.0 + gradient.norm()));
    }
}

TEST(PriorRows, JacobianMatchesDifferences) {
    test::Random random(7);
    const Mat3 R_pred = random.rotation();
    const Mat3 R = R_pred * exp_so3(random.vec3(0.1));
    PriorTerm prior;
    prior.W_r = random_spd(random, 100.0);
    const Vec3 e_r = log_so3(R_pred.transpose() * R);
    const PriorRows rows = make_prior_rows(prior, e_r, Vec3::Zero(), 1.0);
    ASSERT_EQ(rows.count, 3);
    const BlockSpectrum s = decompose(prior.W_r);
    const auto error = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        const Vec3 e = log_so3(R_pred.transpose() * R * exp_so3(Vec3(d)));
        return s.lambda.cwiseSqrt().asDiagonal() * s.v.transpose() * e;
    };
    const Eigen::MatrixXd J = test::numeric_jacobian(error, Vec3::Zero());
    EXPECT_LT((J - rows.rotation.topRows<3>()).norm(), kNumeric);
}

TEST(PriorRows, NoWeightGivesNoRow) {
    EXPECT_EQ(make_prior_rows(PriorTerm{}, Vec3::Ones(), Vec3::Ones(), 0.001).count, 0);
}

}  // namespace
}  // namespace d2lio
