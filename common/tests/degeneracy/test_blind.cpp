// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "../geometry/random_state.hpp"
#include "d2lio/degeneracy/blind.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-12;
constexpr double kDegree = 3.14159265358979 / 180.0;
const NoiseAwareConfig kConfig{0.3, 0.5, 6.0};

Vec3 turned(double degrees, const Vec3& v = Vec3::UnitX()) {
    return Eigen::AngleAxisd(degrees * kDegree, Vec3::UnitZ()) * v;
}

/// All of `d` is noise, nothing of the rest.
NoiseShare blind_along(const Vec3& d, double share = 1.0) {
    NoiseShare s;
    s.share = Vec3(share, 0.0, 0.0);
    s.axes.col(0) = d;
    s.axes.col(1) = d.unitOrthogonal();
    s.axes.col(2) = d.cross(s.axes.col(1));
    return s;
}

/// Long by `ratio` (of variances) along x.
Mat3 long_along_x(double ratio) { return Vec3(1e-4 * ratio, 1e-4, 1e-4).asDiagonal(); }

/// A patch whose normal is uncertain by `sigma` (rad) about y and z.
Patch uncertain(float sigma) {
    Patch p;
    p.covariance = {sigma * sigma, 0.F, 0.F, sigma * sigma, 0.F, 0.F};
    return p;
}

BlindDirections blind_x(double blend = 1.0) {
    BlindDirections b;
    b.count = 1;
    b.axes = Mat3::Identity();
    b.blend[0] = blend;
    return b;
}

/// A row that is alone in its scan, or one beside others.
CleanedRow cleaned(const Vec3& n, const Patch& patch, const BlindDirections& blind,
                   const NoiseAwareConfig& config, const ProvenSum& sum = {}) {
    return cleaned_row(n, proven_share(n, patch, blind, config), blind, sum, 1.0);
}

/// Unit normal with component a along x.
Vec3 leaning(double a) { return {a, 0.0, std::sqrt(1.0 - a * a)}; }

TEST(SurfaceSums, AddUpNormalsAndTheirCovariances) {
    Patch p = uncertain(0.1F);
    p.covariance = {0.01F, 0.F, 0.F, 0.F, 0.F, 0.04F};
    SurfaceSums sums;
    sums.add(Vec3::UnitZ(), p);
    sums.add(Vec3(0.6, 0.8, 0.0), p);
    const Mat3 noise = 2.0 * Vec3(0.01, 0.0, 0.04).asDiagonal().toDenseMatrix();
    EXPECT_LT((sums.noise() - noise).norm(), 1e-7);  // of single precision
    EXPECT_NEAR(sums.information()(0, 1), 0.48, 1e-7);
    EXPECT_NEAR(sums.information()(2, 2), 1.0, kExact);
}

TEST(FindBlind, TakesTheLongAxisOfTheFilterInsideTheCone) {
    for (const double degrees : {0.5, 5.0, 14.0}) {
        const auto b = find_blind(blind_along(turned(degrees)), long_along_x(10.0), kConfig);
        ASSERT_EQ(b.count, 1);
        EXPECT_NEAR(std::abs(b.axes(0, 0)), 1.0, kExact);
    }
    const Vec3 opposite = -turned(5.0);
    EXPECT_NEAR(std::abs(find_blind(blind_along(opposite), long_along_x(10.0), kConfig).axes(0, 0)),
                1.0, kExact);
}

TEST(FindBlind, KeepsTheScansAxisOutsideTheConeAndWhereTheFilterHasNone) {
    const Mat3 broken = Mat3::Constant(std::numeric_limits<double>::quiet_NaN());
    const auto axis = [](double degrees, const Mat3& P) -> Vec3 {
        return find_blind(blind_along(turned(degrees)), P, kConfig).axes.col(0);
    };
    EXPECT_LT((axis(16.0, long_along_x(10.0)) - turned(16.0)).norm(), kExact);
    EXPECT_LT((axis(90.0, long_along_x(10.0)) - turned(90.0)).norm(), kExact);
    EXPECT_LT((axis(5.0, long_along_x(3.9)) - turned(5.0)).norm(), kExact);
    EXPECT_GT((axis(5.0, long_along_x(4.1)) - turned(5.0)).norm(), 0.05);
    EXPECT_LT((axis(5.0, Mat3::Zero()) - turned(5.0)).norm(), kExact);
    EXPECT_LT((axis(5.0, broken) - turned(5.0)).norm(), kExact);
}

TEST(FindBlind, CountsTheDirectionsAboveTheLowShareAndBlendsUpToTheHighOne) {
    NoiseShare s;
    s.share = Vec3(0.9, 0.4, 0.2);
    const auto b = find_blind(s, Mat3::Identity(), kConfig);
    ASSERT_EQ(b.count, 2);
    EXPECT_EQ(b.blend[0], 1.0);
    EXPECT_NEAR(b.blend[1], 0.5, kExact);
    EXPECT_EQ(b.blend[2], 0.0);
    EXPECT_EQ(find_blind(blind_along(Vec3::UnitX(), 0.29), long_along_x(10.0), kConfig).count, 0);
    NoiseAwareConfig bold;
    bold.share_low = 0.0;
    bold.share_high = 0.1;
    EXPECT_EQ(find_blind(s, Mat3::Identity(), bold).count, 3);
}

TEST(StayBlind, KeepsADirectionAsBlindAsItWasWhileItWavers) {
    const auto at = [](double degrees, double share) {
        return find_blind(blind_along(turned(degrees), share), Mat3::Identity(), kConfig);
    };
    const BlindDirections before = at(0.0, 0.9);
    BlindDirections now = at(10.0, 0.41);
    EXPECT_LT(now.blend[0], 0.6);
    stay_blind(before, now);
    EXPECT_EQ(now.blend[0], 1.0);

    for (BlindDirections other : {at(40.0, 0.41), at(0.0, 0.39)}) {
        const double own = other.blend[0];
        stay_blind(before, other);
        EXPECT_EQ(other.blend[0], own);
    }
    BlindDirections more = at(0.0, 0.9);
    stay_blind(at(0.0, 0.41), more);
    EXPECT_EQ(more.blend[0], 1.0);
    BlindDirections seen = at(0.0, 0.29);
    stay_blind(before, seen);
    EXPECT_EQ(seen.count, 0);
}

TEST(FindBlind, SlantedAxesComeOutOrthonormalAndSpanTheSame) {
    test::Random random(1);
    for (int i = 0; i < 50; ++i) {
        NoiseShare s;
        s.share = Vec3(0.9, 0.8, i % 2 == 0 ? 0.7 : 0.0);
        for (int k = 0; k < 3; ++k) s.axes.col(k) = random.vec3(1.0).normalized();
        const auto b = find_blind(s, Mat3::Identity(), kConfig);
        ASSERT_EQ(b.count, i % 2 == 0 ? 3 : 2);
        const auto Q = b.axes.leftCols(b.count);
        EXPECT_LT((Q.transpose() * Q - Eigen::MatrixXd::Identity(b.count, b.count)).norm(), 1e-9);
        EXPECT_LT((Q.col(0) - s.axes.col(0)).norm(), kExact);
        EXPECT_LT((Q * Q.transpose() * s.axes.col(1) - s.axes.col(1)).norm(), 1e-9);
    }
}

TEST(CleanedRow, WithoutBlindDirectionsNothingIsTouched) {
    const Vec3 n = leaning(0.3);
    const BlindDirections none =
        find_blind(blind_along(Vec3::UnitX(), 0.1), Mat3::Identity(), kConfig);
    ASSERT_EQ(none.count, 0);
    const CleanedRow row = cleaned(n, uncertain(1.F), none, kConfig);
    EXPECT_EQ(row.normal, n);
    EXPECT_EQ(row.weight, 1.0);
}

TEST(CleanedRow, ANoisyRowLosesItsComponentAndNothingElse) {
    const Vec3 n = leaning(0.1);
    const CleanedRow row = cleaned(n, uncertain(0.05F), blind_x(), kConfig);  // two sigma
    EXPECT_NEAR(row.normal.x(), 0.0, kExact);
    EXPECT_EQ(row.normal.z(), n.z());
    EXPECT_EQ(row.weight, 1.0);
    const CleanedRow half = cleaned(n, uncertain(0.05F), blind_x(0.5), kConfig);
    EXPECT_NEAR(half.normal.x(), 0.05, kExact);
}

TEST(CleanedRow, ASignificantRowStaysWhole) {
    const Vec3 n = leaning(0.5);
    const CleanedRow row = cleaned(n, uncertain(0.02F), blind_x(), kConfig);  // 25 sigma
    EXPECT_EQ(row.normal, n);
    NoiseAwareConfig strict;
    strict.significance = 30.0;
    EXPECT_NEAR(cleaned(n, uncertain(0.02F), blind_x(), strict).normal.x(), 0.0, kExact);
}

TEST(CleanedRow, SixSigmasAreTheMiddleOfTheFade) {
    const Vec3 n = leaning(0.12);
    const CleanedRow row = cleaned(n, uncertain(0.02F), blind_x(), kConfig);
    EXPECT_NEAR(row.normal.x(), 0.06, 1e-3);
}

TEST(CleanedRow, DoubtCountsAsNoise) {
    const Vec3 n = leaning(0.9), across = n.cross(Vec3::UnitY());
    Patch patch = uncertain(0.02F);
    patch.variance = 4e-4F;
    EXPECT_EQ(cleaned(n, patch, blind_x(), kConfig).normal, n);
    patch.forget_doubt();
    for (int i = 0; i < 5; ++i) {  // four points of a scan line and one beside it
        const Vec3 place =
            i < 4 ? Vec3(0.2 * (i - 1.5) * Vec3::UnitY() - 0.1 * across) : Vec3(0.4 * across);
        Eigen::Map<Eigen::Vector3f>(patch.offsets.data() + 3 * i) = place.cast<float>();
    }
    EXPECT_NEAR(cleaned(n, patch, blind_x(), kConfig).normal.x(), 0.0, kExact);
}

TEST(Trust, HalvesAtThreeSigmasOfRowPatchPredictionAndMapTogether) {
    Patch patch;
    patch.variance = 4e-4F;
    BlindDirections blind = blind_x();
    blind.variance[0] = 1e-4;
    const Vec3 n = leaning(0.6);
    const double S = 1e-3 + 4e-4 + 0.36 * (25e-4 + 9e-4);
    EXPECT_NEAR(trust(3.0 * std::sqrt(S), n, patch, blind, 1e-3), 0.5, 1e-6);
    EXPECT_NEAR(trust(-3.0 * std::sqrt(S), n, patch, blind, 1e-3), 0.5, 1e-6);
    EXPECT_EQ(trust(0.0, n, patch, blind, 1e-3), 1.0);
    EXPECT_LT(trust(0.8, n, patch, blind, 1e-3), 0.1);
    patch.variance = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(trust(0.1, n, patch, blind, 1e-3), 0.0);
}

TEST(CleanedRow, ASurprisingRowCountsLessAsFarAsItSpeaksOfTheBlindDirection) {
    const auto weight = [](double a, double trusted) {
        const Vec3 n = leaning(a);
        const Vec3 share = proven_share(n, uncertain(1e-3F), blind_x(), kConfig);
        ProvenSum many;
        many.information[0] = 1e6;
        return cleaned_row(n, share, blind_x(), many, trusted).weight;
    };
    EXPECT_NEAR(weight(0.9, 0.3), 0.3, 0.01);
    EXPECT_NEAR(weight(0.05, 0.3), 0.65, 0.01);
    EXPECT_GT(weight(0.01, 0.3), 0.95);
    EXPECT_NEAR(weight(0.9, 1.0), 1.0, 1e-4);
}

TEST(FindBlind, KnowsHowFarThePredictionMayBeOffAlongEachAxis) {
    const auto b = find_blind(blind_along(Vec3::UnitX()), long_along_x(10.0), kConfig);
    ASSERT_EQ(b.count, 1);
    EXPECT_NEAR(b.variance[0], 1e-3, 1e-9);
}

TEST(CleanedRow, EachBlindDirectionIsJudgedByItself) {
    BlindDirections both = blind_x();
    both.count = 2;
    both.blend[1] = 1.0;
    Patch p;
    p.covariance = {0.04F, 0.F, 0.F, 25e-6F, 0.F, 0.F};  // uncertain along x only
    const Vec3 n = Vec3(0.3, 0.3, 0.9).normalized();
    const CleanedRow row = cleaned(n, p, both, kConfig);
    EXPECT_NEAR(row.normal.x(), 0.0, kExact);
    EXPECT_EQ(row.normal.y(), n.y());
    EXPECT_EQ(row.normal.z(), n.z());
}

TEST(CleanedRow, TheAxisMayPointAnywhere) {
    BlindDirections slanted = blind_x();
    slanted.axes = Eigen::AngleAxisd(0.7, Vec3(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
    const Vec3 d = slanted.axes.col(0), e = slanted.axes.col(1);
    Patch p;
    const Eigen::Vector3f s = (0.1 * d).cast<float>();
    p.covariance = {s.x() * s.x(), s.x() * s.y(), s.x() * s.z(),
                    s.y() * s.y(), s.y() * s.z(), s.z() * s.z()};
    const Vec3 n = 0.2 * d + std::sqrt(0.96) * e;  // two sigma along the axis
    EXPECT_LT((cleaned(n, p, slanted, kConfig).normal - std::sqrt(0.96) * e).norm(), 1e-7);
}

TEST(CleanedRow, WhatProvesItselfIsHalved) {
    const auto weight = [](double a, double blend = 1.0) {
        return cleaned(leaning(a), uncertain(1e-4F), blind_x(blend), kConfig).weight;
    };
    EXPECT_EQ(weight(0.0), 1.0);
    EXPECT_NEAR(weight(0.05), 0.75, 1e-6);
    EXPECT_NEAR(weight(1.0), 0.5, 2e-3);
    EXPECT_GT(weight(1.0), 0.5);
    EXPECT_GT(weight(0.1, 0.1), weight(0.1, 1.0));
}

TEST(CleanedRow, AmongManyThatProveThemselvesItKeepsItsWeight) {
    const auto weight = [](double others) {
        ProvenSum sum;
        sum.information[0] = others;
        return cleaned(leaning(1.0), uncertain(1e-4F), blind_x(), kConfig, sum).weight;
    };
    EXPECT_NEAR(weight(20.0), 0.75, 2e-3);
    EXPECT_GT(weight(1e4), 0.998);
    EXPECT_LT(weight(1e4), 1.0);
}

TEST(ProvenSum, AddsWhatIsProvenAlongTheBlindAxesOnly) {
    ProvenSum sum;
    for (int i = 0; i < 2; ++i) sum.add(leaning(0.5), Vec3(0.5, 1.0, 1.0), blind_x());
    EXPECT_NEAR(sum.information[0], 2 * 0.25 * 0.25, kExact);
    EXPECT_EQ(sum.information[1], 0.0);
    EXPECT_EQ(sum.information[2], 0.0);
}

TEST(CleanedRow, ZeroSignificanceBelievesEveryRow) {
    NoiseAwareConfig trusting;
    trusting.significance = 0.0;
    EXPECT_EQ(cleaned(leaning(0.1), uncertain(1.F), blind_x(), trusting).normal, leaning(0.1));
    EXPECT_TRUE(cleaned(leaning(0.0), uncertain(0.F), blind_x(), trusting).normal.allFinite());
}

TEST(CleanedRow, APatchThatIsNotANumberSaysNothing) {
    const CleanedRow row = cleaned(leaning(0.9), uncertain(std::nanf("")), blind_x(), kConfig);
    EXPECT_NEAR(row.normal.x(), 0.0, kExact);
    EXPECT_EQ(row.weight, 1.0);
}

/// Largest change of the weighted row over one of `steps` equal steps of a parameter.
template <typename F>
double largest_step(const F& row_at, double from, double to, int steps) {
    double largest = 0.0;
    Vec3 before = row_at(from);
    for (int i = 1; i <= steps; ++i) {
        const Vec3 here = row_at(from + (to - from) * i / steps);
        largest = std::max(largest, (here - before).norm());
        before = here;
    }
    return largest;
}

/// A continuous row moves a hundredth as far in a step a hundredth as long; a jump does not shrink.
template <typename F>
void expect_continuous(const F& row_at, double from, double to) {
    const double coarse = largest_step(row_at, from, to, 1000);
    const double fine = largest_step(row_at, from, to, 100'000);
    EXPECT_GT(coarse, 1e-4);  // it does move
    EXPECT_LT(fine, 0.02 * coarse);
}

Vec3 row_of(const Vec3& n, const Patch& p, const BlindDirections& b, const NoiseAwareConfig& c) {
    const CleanedRow row = cleaned(n, p, b, c);
    return row.weight * row.normal;
}

TEST(CleanedRow, ChangesWithoutAJump) {
    const Mat3 P = long_along_x(10.0);
    for (const float sigma : {0.002F, 0.04F}) {  // a row that stays and one that goes
        expect_continuous(
            [&](double share) {
                const auto b = find_blind(blind_along(turned(3.0), share), P, kConfig);
                return row_of(leaning(0.2), uncertain(sigma), b, kConfig);
            },
            0.0, 1.0);
    }
    expect_continuous(
        [&](double a) { return row_of(leaning(a), uncertain(0.02F), blind_x(), kConfig); }, 0.0,
        0.9);
    expect_continuous(
        [&](double significance) {
            NoiseAwareConfig c;
            c.significance = significance;
            return row_of(leaning(0.2), uncertain(0.02F), blind_x(), c);
        },
        0.0, 20.0);
    expect_continuous(
        [&](double sigma) {
            return row_of(leaning(0.2), uncertain(static_cast<float>(sigma)), blind_x(), kConfig);
        },
        1e-3, 0.2);
}

}  // namespace
}  // namespace d2lio
