// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "d2lio/config/params.hpp"
#include "d2lio/preprocess/extrinsic.hpp"

namespace d2lio {
namespace {

constexpr double kOrthonormal = 1e-12;
constexpr double kPi = 3.14159265358979323846;

double orthonormality_error(const Mat3& R) {
    return (R.transpose() * R - Mat3::Identity()).cwiseAbs().maxCoeff();
}

std::string refusal(const Mat3& R) {
    try {
        checked_rotation(R, "T_imu_lidar");
    } catch (const ConfigError& error) {
        EXPECT_EQ(error.key(), "T_imu_lidar");
        return error.value();
    }
    return "accepted";
}

TEST(Extrinsic, ExactRotationsPassUnchanged) {
    const Mat3 R = Eigen::AngleAxisd(2.5, Vec3(1, -2, 3).normalized()).toRotationMatrix();
    EXPECT_LT((checked_rotation(R, "key") - R).cwiseAbs().maxCoeff(), kOrthonormal);
    const Mat3 flip = Vec3(1, -1, -1).asDiagonal();
    EXPECT_LT((checked_rotation(flip, "key") - flip).cwiseAbs().maxCoeff(), kOrthonormal);
}

TEST(Extrinsic, PublishedCalibrationsAreReorthonormalised) {
    Mat3 subt, geode_alpha;
    subt << 0.999212900, -0.000519121, 0.004, 0.000516111, 0.999218492, -0.000939132, -0.004,
        0.000802565, 0.999993652;
    geode_alpha << 0.9999, 0.0049, 0.0153, -0.0050, 1.0, 0.0021, -0.0153, -0.0022, 0.9999;
    for (const Mat3& R : {subt, geode_alpha}) {
        ASSERT_GT(orthonormality_error(R), 1e-5);
        const Mat3 fixed = checked_rotation(R, "key");
        EXPECT_LT(orthonormality_error(fixed), kOrthonormal);
        EXPECT_NEAR(fixed.determinant(), 1.0, kOrthonormal);
        EXPECT_LT((fixed - R).cwiseAbs().maxCoeff(), kRotationTolerance);
    }
}

TEST(Extrinsic, RotationsRoundedToThreeDecimalsPass) {
    for (int i = 0; i < 200; ++i) {
        const Vec3 axis = Vec3(1.0 + i, 7.0 - i, 0.3 * i).normalized();
        const Mat3 R = Eigen::AngleAxisd(0.03 * i * kPi, axis).toRotationMatrix();
        const Mat3 rounded = (R * 1000.0).array().round().matrix() / 1000.0;
        EXPECT_EQ(refusal(rounded), "accepted");
    }
}

TEST(Extrinsic, OthersAreRefusedWithTheDeterminant) {
    EXPECT_NE(refusal(Mat3::Zero()).find("determinant 0"), std::string::npos);
    EXPECT_NE(refusal(2.0 * Mat3::Identity()).find("determinant 8"), std::string::npos);
    const Mat3 reflection = Vec3(1, 1, -1).asDiagonal();
    EXPECT_NE(refusal(reflection).find("determinant -1"), std::string::npos);
    Mat3 shear = Mat3::Identity();
    shear(0, 1) = 0.1;  // determinant 1 and yet no rotation
    EXPECT_NE(refusal(shear).find("determinant 1"), std::string::npos);
    Mat3 nan = Mat3::Identity();
    nan(2, 2) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NE(refusal(nan).find("nan"), std::string::npos);
}

TEST(Extrinsic, TranslationMustBeFinite) {
    EXPECT_EQ(checked_extrinsic(Mat3::Identity(), Vec3(1, 2, 3), "key").t, Vec3(1, 2, 3));
    EXPECT_THROW(checked_extrinsic(Mat3::Identity(),
                                   Vec3(0, std::numeric_limits<double>::infinity(), 0), "key"),
                 ConfigError);
}

}  // namespace
}  // namespace d2lio
