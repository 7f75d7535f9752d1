// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "d2lio/degeneracy/bend.hpp"
#include "surfaces.hpp"

namespace d2lio {
namespace {

using test::Surface;

constexpr double kRadius = 3.0;          // m, of the tunnel
constexpr double kMean = 0.5 / kRadius;  // 1/m, mean curvature of a cylinder
constexpr double kConverged = 0.1;       // of the curvature, from 200 patches a scan
constexpr double kFalseAlarm = 0.02;     // of facings that noise alone bends
constexpr int kPatches = 200;

/// The wall of a tunnel along x at `angle`, as seen from `origin`; bends towards the axis.
Surface wall(double angle, double bend = 1.0 / kRadius) {
    const Vec3 inward(0.0, -std::cos(angle), -std::sin(angle));
    const Vec3 u = Vec3::UnitX().cross(inward);
    return {-kRadius * inward, u, inward.cross(u), bend, 0.0};
}

/// Adds one scan of patches of a wall; returns their facing.
int look(BendField& field, test::Random& random, const Surface& wall, int patches = kPatches) {
    int facing = 0;
    for (int i = 0; i < patches; ++i) {
        const auto points = wall.sample(test::random_places(random, 0.4), random, test::kMapNoise);
        const Patch patch = points.patch(wall.normal().cast<float>());
        facing = patch.side.facing;
        field.add(patch);
    }
    field.end_scan();
    return facing;
}

TEST(BendField, ACylinderSeenFromInsideConvergesToItsMeanCurvature) {
    test::Random random(1);
    for (const double angle : {0.3, 1.3, 2.0, -1.3}) {
        BendField field;
        int facing = 0;
        for (int scan = 0; scan < 30; ++scan) facing = look(field, random, wall(angle));
        EXPECT_NEAR(static_cast<double>(field.at(facing)), kMean, kConverged * kMean);
        for (int other = 0; other < kFacings; ++other) {
            EXPECT_EQ(field.at(other) != 0.F, other == facing);
        }
    }
}

TEST(BendField, FromOutsideItBendsAway) {
    test::Random random(2);
    BendField field;
    int facing = 0;
    for (int scan = 0; scan < 30; ++scan) {
        facing = look(field, random, wall(1.3, -1.0 / kRadius));
    }
    EXPECT_NEAR(static_cast<double>(field.at(facing)), -kMean, kConverged * kMean);
}

TEST(BendField, NoiseAloneStaysFlat) {
    int bent = 0, looked = 0;
    for (unsigned seed = 0; seed < 100; ++seed) {
        test::Random random(seed);
        BendField field;
        int facing = 0;
        for (int scan = 0; scan < 20; ++scan) facing = look(field, random, wall(1.3, 0.0), 10);
        for (int scan = 0; scan < 5; ++scan) {
            look(field, random, wall(1.3, 0.0), 10);
            ++looked;
            if (field.at(facing) != 0.F) ++bent;
        }
    }
    EXPECT_LT(bent, kFalseAlarm * looked);
}

TEST(BendField, WhatIsBarelySignificantIsShrunk) {
    Patch patch;  // exactly three sigma
    patch.bend_run = 1e-2F;
    patch.bend_rise = 3.F * 0.02F / 0.1F * patch.bend_run;
    BendField field;
    field.add(patch);
    EXPECT_EQ(field.at(patch.side.facing), 0.F);  // not before the scan ends
    field.end_scan();
    EXPECT_NEAR(field.at(patch.side.facing), 0.6F * (1.F - 4.F / 9.F), 1e-5F);
    patch.bend_rise /= 1.51F;  // just under two sigma
    BendField weak;
    weak.add(patch);
    weak.end_scan();
    EXPECT_EQ(weak.at(patch.side.facing), 0.F);
}

TEST(BendField, FadesWithATimeConstantOfTenScans) {
    Patch bent, flat;
    bent.bend_run = flat.bend_run = 10.F;  // so many that noise plays no part
    bent.bend_rise = 2.F;
    BendField field;
    const auto look = [&field](const Patch& patch, int scans) {
        for (int i = 0; i < scans; ++i) {
            field.add(patch);
            field.end_scan();
        }
        return static_cast<double>(field.at(patch.side.facing));
    };
    const double before = look(bent, 80);
    EXPECT_NEAR(before, 0.2, 1e-3);
    EXPECT_NEAR(look(flat, 10) / before, std::exp(-1.0), 0.03);
    EXPECT_LT(look(flat, 60), 0.01 * before);
}

TEST(BendField, WhatIsNoLongerSeenIsForgotten) {
    test::Random random(4);
    BendField field;
    const int facing = look(field, random, wall(1.3));
    ASSERT_GT(field.at(facing), 0.F);
    for (int scan = 0; scan < 200; ++scan) field.end_scan();
    EXPECT_EQ(field.at(facing), 0.F);
}

TEST(BendField, ResetForgetsAtOnce) {
    test::Random random(5);
    BendField field;
    const int facing = look(field, random, wall(1.3));
    ASSERT_NE(field.at(facing), 0.F);
    field.reset();
    EXPECT_EQ(field.at(facing), 0.F);
    field.end_scan();
    EXPECT_EQ(field.at(facing), 0.F);
}

TEST(BendField, TheSpreadOfMeansPutsTheSurfaceBackWhereItWas) {
    constexpr double kLeaf = 0.4;  // m
    constexpr int kPoints = 100;   // of a voxel
    test::Random random(8);
    const Surface vault = wall(1.3);
    BendField field;
    int facing = 0;
    for (int scan = 0; scan < 30; ++scan) facing = look(field, random, vault);
    double with = 0.0, without = 0.0;
    int counted = 0;
    for (int trial = 0; trial < 1000; ++trial) {
        test::Points means;
        const auto places = test::random_places(random, 0.5);
        for (std::size_t i = 0; i < 5; ++i) {
            Vec3 mean = Vec3::Zero();
            for (int k = 0; k < kPoints; ++k) {
                mean += vault.at(places[i] + Eigen::Vector2d(random.vector(2, 0.5 * kLeaf)));
            }
            means.set(static_cast<int>(i), mean / kPoints);
        }
        const Plane plane = means.plane();
        const Patch patch = means.patch(plane.normal);
        if (patch.side.facing != facing) continue;
        const Eigen::Vector3f p = vault.at(Eigen::Vector2d::Zero()).cast<float>();
        const double side = static_cast<double>(patch.side.sign);
        const auto off = [&](double spread) {
            const float sag = field.sag(patch, plane.normal, p, static_cast<float>(spread));
            return side * static_cast<double>(plane.signed_distance(p) - sag);
        };
        with += off(mean_spread(kLeaf));
        without += off(0.0);
        ++counted;
    }
    ASSERT_GT(counted, 300);
    const double inside = kMean * kLeaf * kLeaf / 12.0;  // 2 mm
    EXPECT_NEAR(without / counted, -inside, 0.2 * inside);
    EXPECT_NEAR(with / counted, 0.0, 0.2 * inside);
}

TEST(BendField, APatchThatIsNotANumberBendsNothing) {
    Patch bad;
    bad.bend_rise = bad.bend_run = std::nanf("");
    BendField field;
    field.add(bad);
    field.end_scan();
    EXPECT_EQ(field.at(bad.side.facing), 0.F);
}

}  // namespace
}  // namespace d2lio
