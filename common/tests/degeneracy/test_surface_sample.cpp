// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "d2lio/degeneracy/surface_sample.hpp"
#include "surfaces.hpp"

namespace d2lio {
namespace {

constexpr float kRounding = 1e-5F;  // of sums over a hundred rows, of the largest
constexpr int kRows = 101;          // no multiple of four

/// Surfaces of all shapes, some so thin that next to nothing is known of their normals.
struct Shapes {
    std::vector<test::Points> points;
    std::vector<Plane> planes;
    std::vector<PlaneMoments> moments;

    Shapes() {
        test::Random random(1);
        for (int i = 0; i < kRows; ++i) {
            test::Surface surface = test::random_plane(random);
            surface.bend_u = 0.5;
            test::Places places = test::random_places(random, 0.4);
            if (i % 10 == 3) {
                for (auto& place : places) place.y() *= 0.01;
            }
            points.push_back(surface.sample(places, random, test::kMapNoise));
            moments.emplace_back();
            planes.push_back(points.back().plane(&moments.back()));
        }
    }
    static Eigen::Vector3f matched(const PlaneMoments& m) {
        return m.centroid + Eigen::Vector3f(0.1F, -0.05F, 0.02F);
    }
    static bool left_out(int i) { return i % 7 == 5; }
};

TEST(SurfaceSample, SumsAndBendsAreThoseOfPatches) {
    const Shapes shapes;
    SurfaceSample sample;
    sample.resize(kRows);
    SurfaceSums expected;
    BendField one_by_one, together;
    int capped = 0;
    for (int i = 0; i < kRows; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const test::Points& points = shapes.points[at];
        const Eigen::Vector3f& normal = shapes.planes[at].normal;
        const Patch patch = points.patch(normal);
        sample.set(at, points.xyz.data(), 3, shapes.moments[at], normal, patch.side,
                   Shapes::matched(shapes.moments[at]));
        if (Shapes::left_out(i)) {
            sample.leave_out(at);
            continue;
        }
        expected.add(normal.cast<double>(), patch);
        one_by_one.add(patch);
        const auto& C = patch.covariance;
        if (C[0] + C[3] + C[5] > 0.99F) ++capped;
    }
    EXPECT_GT(capped, 0);
    const SurfaceSums sums = sample.survey(together);
    const auto near = [](const Mat3& a, const Mat3& b) {
        return (a - b).norm() < static_cast<double>(kRounding) * b.norm();
    };
    EXPECT_TRUE(near(sums.information(), expected.information()));
    EXPECT_TRUE(near(sums.noise(), expected.noise())) << sums.noise() << "\n" << expected.noise();
    one_by_one.end_scan();
    together.end_scan();
    EXPECT_TRUE(together.any());
    for (int facing = 0; facing < kFacings; ++facing) {
        EXPECT_NEAR(together.at(facing), one_by_one.at(facing), 1e-3F) << facing;
    }
}

/// A field that has seen surfaces of all facings bend.
BendField bent_field(const Shapes& shapes) {
    BendField field;
    for (int i = 0; i < kRows; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const Patch patch = shapes.points[at].patch(shapes.planes[at].normal);
        field.add(patch.side.facing, 0.3F + 0.01F * static_cast<float>(i), 1.F);
    }
    field.end_scan();
    return field;
}

TEST(SurfaceSample, SagsAndPatchesAreThoseOfTheSingleOnes) {
    const Shapes shapes;
    BendField field = bent_field(shapes);
    SurfaceSample sample;
    sample.resize(kRows);
    std::vector<Sag> sags(SurfaceSample::padded(kRows));
    for (int i = 0; i < kRows; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const Patch patch = shapes.points[at].patch(shapes.planes[at].normal);
        sample.set(at, shapes.points[at].xyz.data(), 3, shapes.moments[at],
                   shapes.planes[at].normal, patch.side, Shapes::matched(shapes.moments[at]));
    }
    const BendField before = field;
    sample.survey(field, sags.data());
    for (int i = 0; i < kRows; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const Eigen::Vector3f& normal = shapes.planes[at].normal;
        const Patch patch = shapes.points[at].patch(normal);
        const Eigen::Vector3f p = Shapes::matched(shapes.moments[at]);
        const float sag = before.sag(patch, normal, p);
        EXPECT_GT(std::abs(sag), 0.F);
        EXPECT_NEAR(sags[at].here, sag, 1e-5F) << i;
        const Eigen::Vector3f step = 1e-2F * normal.unitOrthogonal();
        const float moved = before.sag(patch, normal, p + step) - sag;
        EXPECT_NEAR(sags[at].slope.dot(step), moved, 1e-4F) << i;  // but for the square of the step
        Patch got;
        sample.get(at, got);
        for (std::size_t k = 0; k < 6; ++k) {
            EXPECT_NEAR(got.covariance[k], patch.covariance[k], 1e-4F) << i;
        }
        EXPECT_LT((got.doubt(normal) - patch.doubt(normal)).norm(), 1e-3F) << i;
    }
}

TEST(SurfaceSample, NothingGivesNothing) {
    SurfaceSample sample;
    BendField bends;
    EXPECT_EQ(sample.survey(bends).noise(), Mat3::Zero());
    sample.resize(3);
    for (std::size_t i = 0; i < 3; ++i) sample.leave_out(i);
    const SurfaceSums sums = sample.survey(bends);
    EXPECT_EQ(sums.information(), Mat3::Zero());
    EXPECT_EQ(sums.noise(), Mat3::Zero());
    bends.end_scan();
    EXPECT_FALSE(bends.any());
}

}  // namespace
}  // namespace d2lio
