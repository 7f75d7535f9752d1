// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "d2lio/geometry/so3.hpp"
#include "numeric_jacobian.hpp"
#include "random_state.hpp"

namespace d2lio {
namespace {

constexpr double kExact = 1e-12;
constexpr double kNumeric = 1e-8;  // of central differences with step 1e-6
constexpr double kPi = 3.14159265358979323846;

/// Angles that cross the switch to the series, and near pi.
const double kAngles[] = {0.0, 1e-12, 1e-9, 1e-7, 0.9e-4, 1.1e-4, 1e-2, 1.0, 3.0, kPi - 1e-6};

TEST(SO3, LogInvertsExpAtEveryAngle) {
    test::Random random(1);
    for (const double angle : kAngles) {
        const Vec3 phi = angle * random.vec3(1.0).normalized();
        EXPECT_LT((log_so3(exp_so3(phi)) - phi).norm(), 1e-9 * std::max(angle, 1e-3)) << angle;
    }
}

TEST(SO3, ExpIsARotation) {
    test::Random random(2);
    for (const double angle : kAngles) {
        const Mat3 R = exp_so3(angle * random.vec3(1.0).normalized());
        EXPECT_LT((R * R.transpose() - Mat3::Identity()).norm(), kExact);
        EXPECT_NEAR(R.determinant(), 1.0, kExact);
    }
}

TEST(SO3, LogAtPi) {
    for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(1, 2, 3).normalized()}) {
        const Vec3 phi = log_so3(exp_so3(kPi * axis));
        EXPECT_NEAR(phi.norm(), kPi, 1e-9);
        EXPECT_LT(phi.cross(axis).norm(), 1e-7);
    }
}

TEST(SO3, RightJacobianMatchesDifferences) {
    test::Random random(3);
    for (const double angle : {0.0, 1e-5, 0.9e-4, 1.1e-4, 0.3, 2.5}) {
        const Vec3 phi = angle * random.vec3(1.0).normalized();
        const auto f = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
            return log_so3(exp_so3(phi).transpose() * exp_so3(phi + Vec3(d)));
        };
        const Eigen::MatrixXd J = test::numeric_jacobian(f, Vec3::Zero());
        EXPECT_LT((J - right_jacobian_so3(phi)).norm(), kNumeric) << angle;
    }
}

TEST(SO3, RightJacobianInverseInverts) {
    test::Random random(4);
    for (const double angle : {0.0, 1e-5, 0.9e-4, 1.1e-4, 0.3, 2.5}) {
        const Vec3 phi = angle * random.vec3(1.0).normalized();
        const Mat3 product = right_jacobian_inverse_so3(phi) * right_jacobian_so3(phi);
        EXPECT_LT((product - Mat3::Identity()).norm(), kExact) << angle;
    }
}

}  // namespace
}  // namespace d2lio
