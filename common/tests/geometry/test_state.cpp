// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "d2lio/geometry/sphere.hpp"
#include "d2lio/geometry/state.hpp"
#include "numeric_jacobian.hpp"
#include "random_state.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-10;
constexpr double kNumeric = 2e-8;  // of central differences with step 1e-6

TEST(Sphere, BasisIsOrthonormalAndTangent) {
    test::Random random(1);
    for (int i = 0; i < 100; ++i) {
        const Vec3 g = i == 0 ? Vec3(-9.809, 0, 0) : Vec3(9.809 * random.vec3(1.0).normalized());
        const Mat32 B = sphere_basis(g);
        EXPECT_LT((B.transpose() * B - Mat2::Identity()).norm(), kExact);
        EXPECT_LT((B.transpose() * g).norm(), kExact * 10);
    }
}

TEST(Sphere, MinusInvertsPlus) {
    test::Random random(2);
    for (int i = 0; i < 100; ++i) {
        const Vec3 g = 9.809 * random.vec3(1.0).normalized();
        const Vec2 u = random.vector(2, 1.5);
        EXPECT_LT((sphere_minus(sphere_plus(g, u), g) - u).norm(), kExact);
        EXPECT_NEAR(sphere_plus(g, u).norm(), 9.809, kExact);
    }
    EXPECT_EQ(sphere_minus(Vec3(1, 0, 0), Vec3(1, 0, 0)).norm(), 0.0);
    EXPECT_NEAR(sphere_minus(Vec3(1, 0, 0), Vec3(-1, 0, 0)).norm(), 3.14159265, 1e-6);
}

TEST(Sphere, PlusJacobianMatchesDifferences) {
    test::Random random(3);
    for (int i = 0; i < 20; ++i) {
        const Vec3 g = 9.809 * random.vec3(1.0).normalized();
        const Vec2 u = i == 0 ? Vec2::Zero() : Vec2(random.vector(2, 0.5));
        const auto f = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
            return sphere_plus(g, Vec2(x));
        };
        const Eigen::MatrixXd J = test::numeric_jacobian(f, u);
        EXPECT_LT((J - sphere_plus_jacobian(g, u)).norm(), kNumeric);
    }
}

TEST(Sphere, MinusJacobianInvertsPlusAtZero) {
    test::Random random(4);
    const Vec3 g = 9.809 * random.vec3(1.0).normalized();
    const Mat2 J = sphere_minus_jacobian(g) * sphere_plus_jacobian(g, Vec2::Zero());
    EXPECT_LT((J - Mat2::Identity()).norm(), kExact);
}

TEST(State, MinusInvertsPlus) {
    test::Random random(5);
    for (int i = 0; i < 100; ++i) {
        const NavState x = random.state();
        const Vec23 d = random.vector(23, 0.8);
        EXPECT_LT((state_minus(state_plus(x, d), x) - d).norm(), kExact);
    }
}

TEST(State, TransportMatchesDifferences) {
    test::Random random(6);
    for (int i = 0; i < 20; ++i) {
        const NavState x = random.state();
        const Vec23 d = random.vector(23, 0.4);
        const NavState y = state_plus(x, d);
        const auto f = [&](const Eigen::VectorXd& e) -> Eigen::VectorXd {
            return state_minus(state_plus(x, d + Vec23(e)), y);
        };
        const Eigen::MatrixXd J = test::numeric_jacobian(f, Vec23::Zero());
        EXPECT_LT((J - state_transport(x, d)).norm(), kNumeric);
    }
}

TEST(State, UpstreamTransportDiffersOnlyInTheGravityBlock) {
    test::Random random(7);
    const NavState x = random.state();
    const Vec23 d = random.vector(23, 0.01);
    Mat23x23 gap = state_transport(x, d, true) - state_transport(x, d, false);
    EXPECT_GT(gap.norm(), 0.0);
    EXPECT_LT(gap.norm(), 1e-3);  // second order in the gravity correction
    gap.block<2, 2>(21, 21).setZero();
    EXPECT_EQ(gap.norm(), 0.0);
}

}  // namespace
}  // namespace d2lio
