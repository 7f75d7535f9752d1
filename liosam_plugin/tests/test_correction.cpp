// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "correction.hpp"
#include "d2lio/geometry/so3.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kExact = 1e-12;
constexpr CorrectionNoise kNoise{0.05, 0.1, 1.0, 2.0};

TEST(Correction, UpstreamHasOneSigmaForAllDirections) {
    const Mat6 fine = upstream_correction(kNoise, false), poor = upstream_correction(kNoise, true);
    EXPECT_NEAR(fine(0, 0), 0.0025, kExact);
    EXPECT_NEAR(fine(5, 5), 0.01, kExact);
    EXPECT_NEAR(poor(2, 2), 1.0, kExact);
    EXPECT_NEAR(poor(3, 3), 4.0, kExact);
}

TEST(Correction, WeakDirectionsAloneAreWidened) {
    ScanDiagnostics scan;
    scan.v_r.setIdentity();
    scan.v_t = exp_so3(Vec3(0.1, -0.2, 0.7));
    scan.weak_t = 1;
    const Mat6 C = weak_correction(kNoise, scan);
    const auto variance = [&C, &scan](int i) {
        return scan.v_t.col(i).dot(C.bottomRightCorner<3, 3>() * scan.v_t.col(i));
    };
    EXPECT_NEAR(variance(0), 4.0, kExact);
    EXPECT_NEAR(variance(1), 0.01, kExact);
    EXPECT_NEAR(variance(2), 0.01, kExact);
    EXPECT_NEAR(C(0, 0), 0.0025, kExact);
    scan.v_t.setConstant(kNaN);  // a scan without rows
    EXPECT_TRUE(weak_correction(kNoise, scan).allFinite());
}

TEST(Correction, PoseCovarianceIsTheInformationFormAndNeverExceedsThePrediction) {
    Mat6 A = Mat6::Random();
    const Mat6 P = 1e-4 * (A * A.transpose() + Mat6::Identity());
    A = Mat6::Random();
    const Mat6 AtA = 50.0 * A * A.transpose();
    const Mat6 C = pose_covariance(P, AtA, 1e-3);
    const Mat6 expected = (P.inverse() + AtA / 1e-3).inverse();
    EXPECT_LT((C - expected).norm(), 1e-9 * expected.norm());
    EXPECT_EQ(C, C.transpose());
    EXPECT_LT((pose_covariance(P, Mat6::Zero(), 1e-3) - P).norm(), 1e-12);
    EXPECT_EQ(pose_covariance(-P, AtA, 1e-3), Mat6(-P));  // not definite: left alone
}

TEST(Correction, RosOrderIsPositionThenRotationAboutTheMapsAxes) {
    const Pose T{exp_so3(Vec3(0, 0, M_PI / 2)), Vec3(1, 2, 3)};
    Mat6 C = Mat6::Zero();
    C.diagonal() << 1, 2, 3, 4, 5, 6;  // rotation (body), position (map)
    const Mat6 ros = ros_order(T, C);
    Mat6 expected = Mat6::Zero();
    expected.diagonal() << 4, 5, 6, 2, 1, 3;  // the body's x axis is the map's y axis
    EXPECT_LT((ros - expected).norm(), kExact);
}

double yaw(const Mat3& R) { return std::atan2(R(1, 0), R(0, 0)); }

TEST(Correction, BlendingMovesRollAndPitchPartOfTheWayAndKeepsYaw) {
    const Mat3 R = exp_so3(Vec3(0, 0, 0.8)) * exp_so3(Vec3(0.10, 0.05, 0));
    const Mat3 world = exp_so3(Vec3(0, 0, -2.0)) * exp_so3(Vec3(0.02, -0.04, 0));
    const Vec3 wanted = world.row(2);
    const auto tilt_error = [&wanted](const Mat3& M) {
        return std::acos(std::min(1.0, wanted.dot(Vec3(M.row(2)))));
    };
    const double before = tilt_error(R);
    EXPECT_NEAR(tilt_error(blend_tilt(R, world, 0.25)), 0.75 * before, 1e-9);
    EXPECT_NEAR(tilt_error(blend_tilt(R, world, 1.0)), 0.0, 1e-7);
    EXPECT_NEAR(yaw(blend_tilt(R, world, 1.0)), yaw(R), 1e-9);
    EXPECT_EQ(blend_tilt(R, world, 0.0), R);
    EXPECT_EQ(blend_tilt(R, exp_so3(Vec3(0, 1.5, 0)), 0.5), R);  // too steep
    EXPECT_EQ(blend_tilt(R, Mat3::Constant(kNaN), 0.5), R);
}

}  // namespace
}  // namespace d2lio::liosam
