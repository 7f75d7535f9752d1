// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <limits>
#include <random>

#include "d2lio/degeneracy/scan_error.hpp"

namespace d2lio {
namespace {

using Mat6 = Eigen::Matrix<double, 6, 6>;
using Vec6 = Eigen::Matrix<double, 6, 1>;

constexpr double kTolerance = 1e-9;  ///< relative

/// A^T A and A^T b of random rows; `blind`: none of them speaks of the last state.
struct Equations {
    explicit Equations(bool blind = false) {
        std::mt19937 random(7);
        std::normal_distribution<double> normal;
        for (int i = 0; i < 50; ++i) {
            Vec6 row;
            for (double& v : row) v = normal(random);
            if (blind) row[5] = 0.0;
            AtA += row * row.transpose();
            Atb += normal(random) * row;
        }
    }
    Mat6 AtA = Mat6::Zero();
    Vec6 Atb = Vec6::Zero();
};

const Vec6 kError = (Vec6() << 0.3, 0.3, 0.3, 0.01, 0.01, 0.01).finished();

TEST(ScanError, DoubtsThePositionAsFarAsADirectionIsBlind) {
    BlindDirections blind;
    EXPECT_DOUBLE_EQ(scan_error(blind, 1.0).position, 0.0);
    blind.count = 2;
    blind.blend = {1.0, 0.25, 0.9};  // the third does not count
    const double whole = scan_error(blind, 1.0).position;
    EXPECT_DOUBLE_EQ(whole, 25e-6);
    blind.blend[0] = 0.5;
    EXPECT_DOUBLE_EQ(scan_error(blind, 1.0).position, 0.5 * whole);
}

TEST(ScanError, DoubtsTheRotationAsFarAsTheRowsDisagree) {
    const BlindDirections none;
    EXPECT_DOUBLE_EQ(scan_error(none, 1.0).rotation, 0.25e-6);
    EXPECT_DOUBLE_EQ(scan_error(none, 0.1).rotation, 0.25e-10);
    EXPECT_EQ(scan_error(none, 0.0).rotation, 0.0);
    EXPECT_DOUBLE_EQ(scan_error(none, 1e9).rotation, 16 * 0.25e-6);
    EXPECT_DOUBLE_EQ(scan_error(none, std::numeric_limits<double>::quiet_NaN()).rotation,
                     16 * 0.25e-6);
}

TEST(ScanError, AddsItsVarianceToThatOfTheSolution) {
    Equations e;
    const Mat6 covariance = e.AtA.inverse();
    limit_information<6>(kError, e.AtA, e.Atb);
    const Mat6 expected = covariance + Mat6(kError.asDiagonal());
    EXPECT_TRUE(e.AtA.inverse().isApprox(expected, kTolerance));
}

TEST(ScanError, LeavesTheSolutionWhereItIs) {
    Equations e;
    const Vec6 solution = e.AtA.ldlt().solve(e.Atb);
    limit_information<6>(kError, e.AtA, e.Atb);
    EXPECT_TRUE(Vec6(e.AtA.ldlt().solve(e.Atb)).isApprox(solution, kTolerance));
}

TEST(ScanError, LimitsWhatManyRowsClaim) {
    Equations e;
    e.AtA *= 1e9;
    limit_information<6>(kError, e.AtA, e.Atb);
    EXPECT_TRUE(e.AtA.isApprox(Mat6(kError.cwiseInverse().asDiagonal()), 1e-6));
}

TEST(ScanError, AddsNothingToABlindDirection) {
    Equations e(true);
    limit_information<6>(kError, e.AtA, e.Atb);
    EXPECT_TRUE(e.AtA.allFinite() && e.Atb.allFinite());
    EXPECT_TRUE(e.AtA.row(5).isZero(0.0));
    EXPECT_EQ(e.Atb[5], 0.0);
}

TEST(ScanError, IsNothingWhereItIsZero) {
    Equations e;
    const Equations before = e;
    limit_information<6>(Vec6::Zero(), e.AtA, e.Atb);
    EXPECT_TRUE(e.AtA.isApprox(before.AtA, kTolerance));
    EXPECT_TRUE(e.Atb.isApprox(before.Atb, kTolerance));
}

}  // namespace
}  // namespace d2lio
