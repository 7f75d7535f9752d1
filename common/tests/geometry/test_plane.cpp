// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <array>
#include <limits>

#include "d2lio/geometry/plane.hpp"
#include "random_state.hpp"

namespace d2lio {
namespace {

using Patch = std::array<Eigen::Vector3f, 5>;

PlaneStatus fit(const Patch& patch, Plane& plane, const PlaneFitOptions& options = {}) {
    return fit_plane(patch[0].data(), 3, 5, options, plane);
}

/// Five points near the plane through `centre` with the given normal.
Patch noisy_patch(test::Random& random, const Vec3& centre, const Vec3& normal, double noise) {
    const Mat3 R = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), normal).toRotationMatrix();
    Patch patch;
    for (auto& p : patch) {
        const Vec3 local(random.uniform(-.4, .4), random.uniform(-.4, .4), noise * random.normal());
        p = (centre + R * local).cast<float>();
    }
    return patch;
}

/// The defining least-squares problem A u = -1, solved by QR in double.
Eigen::Vector4d reference_plane(const Patch& patch) {
    Eigen::Matrix<double, 5, 3> A;
    for (int i = 0; i < 5; ++i) A.row(i) = patch[static_cast<std::size_t>(i)].cast<double>();
    const Vec3 u = A.colPivHouseholderQr().solve(Eigen::Matrix<double, 5, 1>::Constant(-1.0));
    Eigen::Vector4d out;
    out << u / u.norm(), 1.0 / u.norm();
    return out;
}

TEST(PlaneFit, EqualsTheLeastSquaresProblem) {
    test::Random random(1);
    PlaneFitOptions loose;
    loose.max_distance = 1e9F;
    for (int i = 0; i < 500; ++i) {
        const Patch patch =
            noisy_patch(random, random.vec3(30.0), random.vec3(1.0).normalized(), 0.02);
        Plane plane;
        ASSERT_EQ(fit(patch, plane, loose), PlaneStatus::kOk);
        const Eigen::Vector4d expected = reference_plane(patch);
        EXPECT_LT((plane.normal.cast<double>() - expected.head<3>()).norm(), 1e-5);
        EXPECT_NEAR(plane.d, expected[3], 2e-5 * (1.0 + std::abs(expected[3])));
    }
}

TEST(PlaneFit, ExactPlaneFarFromTheOrigin) {
    test::Random random(2);
    const Vec3 normal = Vec3(1, 2, 3).normalized();
    const Patch patch = noisy_patch(random, Vec3(2e4, -1e4, 500.0), normal, 0.0);
    Plane plane;
    ASSERT_EQ(fit(patch, plane), PlaneStatus::kOk);
    EXPECT_GT(std::abs(plane.normal.cast<double>().dot(normal)), 0.99999);
}

TEST(PlaneFit, RefusesCollinearPoints) {
    Patch patch;
    for (int i = 0; i < 5; ++i) {
        patch[static_cast<std::size_t>(i)] = {3.F, 0.1F * static_cast<float>(i), 1.F};
    }
    Plane plane;
    EXPECT_EQ(fit(patch, plane), PlaneStatus::kSingular);
}

TEST(PlaneFit, RefusesCoincidentPoints) {
    Patch patch;
    patch.fill({1.F, 2.F, 3.F});
    Plane plane;
    EXPECT_EQ(fit(patch, plane), PlaneStatus::kSingular);
    PlaneFitOptions upstream;
    upstream.min_spread_ratio = 0.0;
    EXPECT_EQ(fit(patch, plane, upstream), PlaneStatus::kSingular);
}

TEST(PlaneFit, RefusesNaN) {
    Patch patch;
    patch.fill({1.F, 2.F, std::numeric_limits<float>::quiet_NaN()});
    Plane plane;
    EXPECT_EQ(fit(patch, plane), PlaneStatus::kSingular);
}

TEST(PlaneFit, RefusesRoughPatch) {
    Patch patch{{{5, 5, 5}, {6, 5, 5}, {5, 6, 5}, {6, 6, 5}, {5.5F, 5.5F, 5.6F}}};
    Plane plane;
    EXPECT_EQ(fit(patch, plane), PlaneStatus::kRough);
    patch[4].z() = 5.05F;
    EXPECT_EQ(fit(patch, plane), PlaneStatus::kOk);
}

}  // namespace
}  // namespace d2lio
