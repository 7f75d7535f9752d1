// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cstring>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/ros1/messages.hpp"

namespace d2lio::ros1 {
namespace {

const Frames kFrames{"map", "imu"};

ScanResult weak_result() {
    ScanResult r;
    r.stamp = 1'700'000'000'123'456'789;
    r.has_pose = true;
    r.health = Health::kDegenerate;
    r.status = ScanStatus::kOk;
    r.state.pos = Vec3(1, 2, 3);
    r.state.rot = exp_so3(Vec3(0, 0, 1.0));
    r.state.vel = Vec3(2, 0, 0);
    for (int i = 0; i < 36; ++i) r.covariance(i / 6, i % 6) = i;
    r.diagnostics.lambda_r = Vec3(100, 200, 300);
    r.diagnostics.lambda_t = Vec3(4, 100, 400);
    r.diagnostics.v_r = r.diagnostics.v_t = Mat3::Identity();
    r.diagnostics.weak_t = 1;
    return r;
}

TEST(Messages, StampsAreExactAndThoseThatDoNotFitAreZero) {
    const ros::Time t = to_time(1'700'000'000'123'456'789);
    EXPECT_EQ(t.sec, 1'700'000'000U);
    EXPECT_EQ(t.nsec, 123'456'789U);
    EXPECT_TRUE(to_time(-1).isZero());
    EXPECT_TRUE(to_time(Stamp{1} << 62).isZero());
}

TEST(Messages, OdometryKeepsRowsOfTheCovarianceAndTurnsTheTwistIntoTheBody) {
    ScanResult r = weak_result();
    r.state.gyro_bias = Vec3(0, 0, 0.1);
    const nav_msgs::Odometry odometry = to_odometry(r, kFrames, Vec3(0, 0, 0.5));
    EXPECT_EQ(odometry.header.frame_id, "map");
    EXPECT_EQ(odometry.child_frame_id, "imu");
    EXPECT_EQ(odometry.pose.covariance[6 * 2 + 3], 15.0);
    EXPECT_EQ(odometry.pose.pose.position.y, 2.0);
    EXPECT_NEAR(odometry.pose.pose.orientation.z, std::sin(0.5), 1e-12);
    EXPECT_NEAR(odometry.twist.twist.linear.x, 2.0 * std::cos(1.0), 1e-12);
    EXPECT_NEAR(odometry.twist.twist.linear.y, -2.0 * std::sin(1.0), 1e-12);
    EXPECT_NEAR(odometry.twist.twist.angular.z, 0.4, 1e-12);
}

TEST(Messages, StatusTellsHealthAndMessage) {
    ScanResult r = weak_result();
    EXPECT_EQ(to_status(r, "/node", "fastlio").level, diagnostic_msgs::DiagnosticStatus::WARN);
    r.health = Health::kLost;
    r.message = "why";
    const auto status = to_status(r, "/node", "fastlio");
    EXPECT_EQ(status.level, diagnostic_msgs::DiagnosticStatus::ERROR);
    EXPECT_EQ(status.name, "/node: scan");
    EXPECT_EQ(status.message, "ok, LOST: why");
}

TEST(Messages, MarkersShowWeakDirectionsOnlyAndTheLongestAxisAlongTheWeakest) {
    const auto markers = to_markers(weak_result(), "map").markers;
    int shown = 0;
    for (const auto& m : markers) {
        const bool arrow = m.ns == "weak_translation" || m.ns == "weak_rotation";
        shown += arrow && m.action == visualization_msgs::Marker::ADD ? 1 : 0;
        if (m.ns != "information") continue;
        EXPECT_NEAR(m.scale.x / m.scale.y, 5.0, 1e-9);  // sqrt(100 / 4)
        EXPECT_NEAR(m.scale.x / m.scale.z, 10.0, 1e-9);
    }
    EXPECT_EQ(shown, 1);
    ScanResult blind = weak_result();
    blind.diagnostics = ScanDiagnostics{};
    for (const auto& m : to_markers(blind, "map").markers) {
        EXPECT_EQ(m.action == visualization_msgs::Marker::ADD, m.ns == "health") << m.ns;
    }
}

TEST(Messages, RejectedPointsCarryColourAndReason) {
    const ScanPoints scan{{{1, 2, 3}, {4, 5, 6}}, {Verdict::kAccepted, Verdict::kResidual}};
    const sensor_msgs::PointCloud2 cloud = to_rejected(scan, 5, "map");
    ASSERT_EQ(cloud.width, 1U);
    ASSERT_EQ(cloud.data.size(), 17U);
    float x = 0.F;
    std::uint32_t rgb = 0;
    std::memcpy(&x, cloud.data.data(), 4);
    std::memcpy(&rgb, cloud.data.data() + 12, 4);
    EXPECT_EQ(x, 4.F);
    EXPECT_EQ(rgb, colour_of(Verdict::kResidual));
    EXPECT_EQ(cloud.data[16], static_cast<std::uint8_t>(Verdict::kResidual));
    EXPECT_EQ(to_rejected({{{1, 2, 3}}, {}}, 5, "map").width, 0U);  // no verdicts
}

TEST(Messages, RegisteredPointsTakeThePoseOfTheirOwnInstant) {
    Scan scan;
    scan.stamp = 1'000'000'000;
    for (const std::int32_t dt : {0, 50'000'000, 100'000'000}) {
        LidarPoint p;
        p.x = 10.F;
        p.dt_ns = dt;
        scan.points.push_back(p);
    }
    LidarPoint near;
    near.x = 0.1F;
    scan.points.push_back(near);
    Pose previous, current;
    current.t.x() = 2.0;
    const Pose lever{Mat3::Identity(), Vec3(0, 0, 1)};
    const auto out = registered(scan, previous, scan.stamp, current, 1'100'000'000, lever, 0.5);
    ASSERT_EQ(out.size(), 3U);  // the nearest lies within the blind zone
    EXPECT_NEAR(out[0].x, 10.F, 1e-5F);
    EXPECT_NEAR(out[1].x, 11.F, 1e-5F);
    EXPECT_NEAR(out[2].x, 12.F, 1e-5F);
    EXPECT_NEAR(out[2].z, 1.F, 1e-5F);
}

TEST(Messages, PcdHoldsPackedPoints) {
    const std::string pcd = to_pcd({{1, 2, 3}, {4, 5, 6}});
    const std::size_t data = pcd.find("DATA binary\n") + 12;
    EXPECT_NE(pcd.find("POINTS 2\n"), std::string::npos);
    ASSERT_EQ(pcd.size() - data, 24U);
    float last = 0.F;
    std::memcpy(&last, pcd.data() + data + 20, 4);
    EXPECT_EQ(last, 6.F);
}

}  // namespace
}  // namespace d2lio::ros1
