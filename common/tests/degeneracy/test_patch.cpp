// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <set>

#include "d2lio/degeneracy/blind.hpp"
#include "d2lio/degeneracy/patch.hpp"
#include "surfaces.hpp"

namespace d2lio {
namespace {

using test::Places;
using test::Points;
using test::Surface;

constexpr double kMonteCarlo = 0.06;   // of a covariance from 8000 draws
constexpr double kRounding = 2e-3;     // of single precision through an inverse
constexpr double kSmallAngles = 0.03;  // of heights up to a tenth of the patch's size
constexpr double kCap = 1.0001;        // rad
const float kNotANumber = std::numeric_limits<float>::quiet_NaN();

/// The documented variance of a neighbour's height where the fit leaves nothing.
double height_variance(double extent) {
    const double bend = 0.5 * 0.5 * extent;
    return test::kMapNoise * test::kMapNoise + bend * bend;
}

Mat3 covariance(const Patch& p) {
    SurfaceSums sums;
    sums.add(Vec3::UnitX(), p);
    return sums.noise();
}

Eigen::Matrix2d scatter(const Places& places, int without = -1) {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    int n = 0;
    for (int i = 0; i < 5; ++i) {
        if (i == without) continue;
        mean += places[static_cast<std::size_t>(i)];
        ++n;
    }
    mean /= n;
    Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
    for (int i = 0; i < 5; ++i) {
        if (i == without) continue;
        const Eigen::Vector2d y = places[static_cast<std::size_t>(i)] - mean;
        S += y * y.transpose();
    }
    return S;
}

/// Long in one direction, so that a wrong inverse would show.
const Places kOblong{Eigen::Vector2d(-0.5, -0.1), Eigen::Vector2d(0.4, -0.2),
                     Eigen::Vector2d(0.5, 0.15), Eigen::Vector2d(-0.4, 0.2),
                     Eigen::Vector2d(0.1, 0.05)};

TEST(Patch, CovarianceOfTheNormalIsThatOfRepeatedFits) {
    test::Random random(1);
    for (int round = 0; round < 3; ++round) {
        const Surface plane = test::random_plane(random);
        const Vec3 n = plane.normal();
        Mat3 measured = Mat3::Zero();
        constexpr int kDraws = 8000;
        for (int i = 0; i < kDraws; ++i) {
            Vec3 fitted =
                plane.sample(kOblong, random, test::kMapNoise).plane().normal.cast<double>();
            if (fitted.dot(n) < 0.0) fitted = -fitted;
            const Vec3 e = fitted - fitted.dot(n) * n;
            measured += e * e.transpose() / kDraws;
        }
        const Mat3 told = covariance(plane.sample(kOblong, random, 0.0).patch());
        const double extent = scatter(kOblong).trace() / 5.0;
        const double allowance = height_variance(extent) / (test::kMapNoise * test::kMapNoise);
        EXPECT_LT((told / allowance - measured).norm(), kMonteCarlo * measured.norm());
        EXPECT_GT(allowance, 1.1);  // the bend that is allowed for makes it larger, never smaller
        EXPECT_LT((told * n).norm(), kRounding * told.norm());
    }
}

TEST(Patch, AFitThatLeavesMoreThanTwoCentimetresSaysSo) {
    test::Random random(2);
    const Surface plane = test::random_plane(random);
    const Patch smooth = plane.sample(test::square(0.3), random, 0.0).patch();
    Points rough;  // a saddle: the fitted plane stays where it is
    for (int i = 0; i < 5; ++i) {
        const auto y = test::square(0.3)[static_cast<std::size_t>(i)];
        rough.set(i, plane.at(y) + (y.x() * y.y() > 0.0 ? 0.05
                                    : i == 4            ? 0.0
                                                        : -0.05) *
                                       plane.normal());
    }
    const double extent = 4.0 * 2.0 * 0.09 / 5.0;
    const double residual = 4.0 * 0.05 * 0.05 / 2.0;
    const double expected = (residual + std::pow(0.25 * extent, 2)) / height_variance(extent);
    const double ratio =
        covariance(rough.patch(plane.normal().cast<float>())).trace() / covariance(smooth).trace();
    EXPECT_NEAR(ratio, expected, kRounding * expected);
}

TEST(Patch, DoubtIsTheWorstOfLeavingOneNeighbourOut) {
    test::Random random(3);
    for (int round = 0; round < 20; ++round) {
        const Surface plane = test::random_plane(random);
        const Places places = test::random_places(random, 0.4);
        const Eigen::Matrix2d all = scatter(places).inverse();
        double worst = 0.0;
        for (int i = 0; i < 5; ++i) {
            worst = std::max(worst, (scatter(places, i).inverse() - all).trace());
        }
        const double expected = height_variance(scatter(places).trace() / 5.0) * worst;
        const Eigen::Vector3f n = plane.normal().cast<float>();
        const Patch patch = plane.sample(places, random, 0.0).patch(n);
        EXPECT_NEAR(patch.doubt(n).squaredNorm(), std::min(expected, 1.0),
                    0.02 * std::min(expected, 1.0));
    }
}

TEST(Patch, NoNormalIsKnownBetterThanTheBoundSays) {
    test::Random random(14);
    float least = 1.F;
    for (const double size : {0.01, 0.1, 0.3, 0.6, 1.0, 3.0}) {
        for (int round = 0; round < 50; ++round) {
            const Surface plane = test::random_plane(random);
            const Patch p = plane.sample(test::random_places(random, size), random, 0.0).patch();
            for (int i = 0; i < 20; ++i) {
                const double angle = random.uniform(0.0, 3.1416);
                const Vec3 d = std::cos(angle) * plane.u + std::sin(angle) * plane.v;
                least = std::min(least, p.formal_variance(d.cast<float>()));
            }
        }
    }
    EXPECT_GE(least, 0.99F * Patch::kLeastVariance);
    EXPECT_LT(least, 1.3F * Patch::kLeastVariance);  // a bound that tells something
}

TEST(Patch, FourPointsOfAScanLineAndOneBesideItAreDoubted) {
    test::Random random(4);
    const Surface plane = test::random_plane(random);
    const Places line{Eigen::Vector2d(-0.3, 0.0), Eigen::Vector2d(-0.1, 0.0),
                      Eigen::Vector2d(0.1, 0.0), Eigen::Vector2d(0.3, 0.0),
                      Eigen::Vector2d(0.0, 0.4)};
    const Eigen::Vector3f n = plane.normal().cast<float>();
    const Patch thin = plane.sample(line, random, 0.0).patch(n);
    EXPECT_GT(std::abs(thin.doubt(n).cast<double>().dot(plane.v)), 0.9);
    EXPECT_LT(std::abs(thin.doubt(n).cast<double>().dot(plane.u)), 0.1);
    EXPECT_GT(thin.variance_along(plane.v, plane.normal()), 0.8);
    const Patch wide = plane.sample(test::square(0.3), random, 0.0).patch(n);
    EXPECT_LT(wide.doubt(n).norm(), 0.2F);
}

TEST(Patch, VarianceAlongADirectionAddsUp) {
    test::Random random(12);
    const Surface plane = test::random_plane(random);
    const Vec3 n = plane.normal();
    const Patch p = plane.sample(kOblong, random, 0.0).patch(n.cast<float>());
    const Vec3 doubt = p.doubt(n.cast<float>()).cast<double>();
    const Mat3 C = covariance(p);
    for (int round = 0; round < 10; ++round) {
        const Vec3 d = random.rotation().col(0);
        EXPECT_NEAR(p.formal_variance(d.cast<float>()), d.dot(C * d), 1e-6);
        const double total = C.trace() + doubt.squaredNorm();
        const double second_order = 0.5 * std::pow(total * n.dot(d), 2);
        const double expected = d.dot(C * d) + std::pow(doubt.dot(d), 2) + second_order;
        EXPECT_NEAR(p.variance_along(d, n), expected, 1e-6);
    }
    EXPECT_GT(doubt.norm(), 0.02);
}

TEST(Patch, ANormalLostByHalfARadianSaysNothing) {
    Patch p;
    p.covariance = {0.F, 0.F, 0.F, 9e-4F, 0.F, 16e-4F};
    EXPECT_GT(1.0 / std::sqrt(p.variance_along(Vec3::UnitX(), Vec3::UnitX())), 100.0);  // sigmas
    Patch lost;
    lost.covariance[3] = 0.25F;
    EXPECT_LT(1.0 / std::sqrt(lost.variance_along(Vec3::UnitX(), Vec3::UnitX())), 6.0);
}

/// bend_u = bend_v is a sphere, bend_v = 0 a cylinder.
struct Bent {
    Surface surface;
    double mean() const { return 0.5 * (surface.bend_u + surface.bend_v); }
};

TEST(Patch, FindsTheMeanCurvatureOfSpheresAndCylinders) {
    test::Random random(5);
    for (const double bend : {0.2, -0.2}) {
        for (const bool cylinder : {false, true}) {
            Bent bent{test::random_plane(random)};
            bent.surface.bend_u = bend;
            bent.surface.bend_v = cylinder ? 0.0 : bend;
            const Points points = bent.surface.sample(test::square(0.3), random, 0.0);
            const Vec3 n = bent.surface.normal();
            const Vec3 above = bent.surface.origin + 5.0 * n, below = bent.surface.origin - 5.0 * n;
            for (const double sign : {1.0, -1.0}) {  // whichever way the fitted normal looks
                const Eigen::Vector3f fitted = (sign * n).cast<float>();
                const Patch in = points.patch(fitted, above), out = points.patch(fitted, below);
                EXPECT_NEAR(in.bend_rise / in.bend_run, bent.mean(), kSmallAngles * 0.2);
                EXPECT_NEAR(out.bend_rise / out.bend_run, -bent.mean(), kSmallAngles * 0.2);
                EXPECT_EQ(in.side.sign, sign > 0.0 ? 1.F : -1.F);
                EXPECT_EQ(out.side.sign, -in.side.sign);
                EXPECT_NE(in.side.facing, out.side.facing);
            }
        }
    }
}

TEST(Patch, SagIsTheDistanceOfABentSurfaceFromItsPlane) {
    test::Random random(6);
    for (int round = 0; round < 10; ++round) {
        Surface sphere = test::random_plane(random);
        sphere.bend_u = sphere.bend_v = 0.2;
        const Points points = sphere.sample(test::random_places(random, 0.4), random, 0.0);
        const Plane plane = points.plane();
        const Vec3 sensor = sphere.origin + 3.0 * sphere.normal();
        const Patch patch = points.patch(plane.normal, sensor);
        double largest = 0.0;
        for (int i = 0; i < 5; ++i) {
            const Eigen::Vector3f p = sphere.at(test::random_places(random, 0.3)[0]).cast<float>();
            const double plain = static_cast<double>(plane.signed_distance(p));
            const double sag =
                0.2 * static_cast<double>(patch.side.sign * patch.sag(plane.normal, p));
            largest = std::max(largest, std::abs(plain));
            EXPECT_NEAR(sag, plain, 1e-3 + 0.1 * std::abs(plain));  // of a parabola
        }
        EXPECT_GT(largest, 5e-3);
    }
}

TEST(Patch, AFlatPlaneHasNoBend) {
    test::Random random(7);
    for (int round = 0; round < 10; ++round) {
        const Surface plane = test::random_plane(random);
        const Patch p = plane.sample(test::random_places(random, 0.4), random, 0.0).patch();
        EXPECT_GT(p.bend_run, 1e-6F);
        EXPECT_LT(std::abs(p.bend_rise / p.bend_run), 1e-3F);
    }
}

TEST(Patch, FacingBinsTellDirectionsApartAndStayInRange) {
    test::Random random(8);
    std::set<int> seen;
    for (int i = 0; i < 2000; ++i) {
        const Surface plane = test::random_plane(random);
        const Points points = plane.sample(test::square(0.3), random, 0.0);
        const int facing = points.patch(plane.normal().cast<float>()).side.facing;
        ASSERT_GE(facing, 0);
        ASSERT_LT(facing, kFacings);
        EXPECT_EQ(points.patch(-plane.normal().cast<float>()).side.facing, facing);
        seen.insert(facing);
    }
    EXPECT_GT(seen.size(), 30U);
}

void expect_harmless(const Patch& p, const Eigen::Vector3f& normal) {
    const Mat3 C = covariance(p);
    const Eigen::Vector3f doubt = p.doubt(normal);
    EXPECT_TRUE(C.allFinite() && doubt.allFinite());
    EXPECT_LE(C.trace(), 2.0 * kCap * kCap);
    EXPECT_LE(doubt.norm(), kCap);
    EXPECT_TRUE(p.centroid.allFinite() && p.sag_slope.allFinite());
    EXPECT_TRUE(std::isfinite(p.bend_rise) && std::isfinite(p.bend_run));
    EXPECT_TRUE(std::isfinite(p.sag({0.F, 0.F, 1.F}, {1.F, 2.F, 3.F})));
    EXPECT_GE(p.variance_along(Vec3::UnitX(), normal.cast<double>()), 0.0);
}

TEST(Patch, CoincidentCollinearAndTooFewPointsStayFinite) {
    const Eigen::Vector3f n = Eigen::Vector3f::UnitZ();
    Points same, line;
    for (int i = 0; i < 5; ++i) {
        same.set(i, Vec3(1.0, 2.0, 3.0));
        line.set(i, Vec3(1.0 + 0.1 * i, 2.0, 3.0));
    }
    expect_harmless(same.patch(n), n);
    const Patch thin = line.patch(n);
    expect_harmless(thin, n);
    EXPECT_GT(thin.variance_along(Vec3::UnitY(), Vec3::UnitZ()),
              0.9);  // nothing is known across the line
    for (int count = 0; count < 5; ++count) {
        Patch few = thin;
        make_patch(line.xyz.data(), 3, count, {}, n, {}, few);
        expect_harmless(few, n);
        EXPECT_GE(few.variance_along(Vec3::UnitX(), Vec3::UnitZ()), 0.99);
        EXPECT_GE(few.variance_along(Vec3::UnitY(), Vec3::UnitZ()), 0.99);
    }
}

TEST(Patch, HugeAndTinyPatchesStayFinite) {
    test::Random random(9);
    for (const double half : {1e-4, 1e-2, 10.0, 1e3}) {
        Surface plane = test::random_plane(random);
        plane.origin *= 100.0;
        const Eigen::Vector3f n = plane.normal().cast<float>();
        expect_harmless(plane.sample(test::random_places(random, half), random, 0.0).patch(n), n);
    }
}

TEST(Patch, ANotANumberNeverLooksCertain) {
    test::Random random(10);
    const Surface plane = test::random_plane(random);
    Points points = plane.sample(test::square(0.3), random, 0.0);
    points.xyz[4] = kNotANumber;
    const Patch p = points.patch(plane.normal().cast<float>());
    const Vec3 n(0.5, std::sqrt(0.75), 0.0);
    EXPECT_FALSE(0.25 > p.variance_along(Vec3::UnitX(), n));
    EXPECT_FALSE(0.25F > p.formal_variance(Eigen::Vector3f::UnitX()));
}

TEST(Patch, TheStrideSkipsWhatIsBetween) {
    test::Random random(11);
    const Surface plane = test::random_plane(random);
    const Points points = plane.sample(test::random_places(random, 0.3), random, test::kMapNoise);
    std::array<float, 40> spread;
    spread.fill(kNotANumber);
    for (std::size_t i = 0; i < 15; ++i) spread[8 * (i / 3) + i % 3] = points.xyz[i];
    const Eigen::Vector3f n = points.plane().normal;
    const Patch a = points.patch(n);
    Patch b;
    make_patch(spread.data(), 8, 5, points.moments(), n, a.side, b);
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.doubt(n), b.doubt(n));
    EXPECT_EQ(a.bend_rise, b.bend_rise);
    EXPECT_EQ(a.sag_slope, b.sag_slope);
}

}  // namespace
}  // namespace d2lio
