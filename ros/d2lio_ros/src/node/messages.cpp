// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/messages.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace d2lio::ros1 {
namespace {

geometry_msgs::Quaternion to_quaternion(const Mat3& R) {
    const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
    geometry_msgs::Quaternion out;
    out.x = q.x();
    out.y = q.y();
    out.z = q.z();
    out.w = q.w();
    return out;
}

/// @tparam Message geometry_msgs::Point or Vector3.
template <typename Message>
Message to_xyz(const Vec3& v) {
    Message out;
    out.x = v.x();
    out.y = v.y();
    out.z = v.z();
    return out;
}

std_msgs::ColorRGBA colour(Health health, float alpha) {
    std_msgs::ColorRGBA out;
    out.a = alpha;
    out.r = health == Health::kOk ? 0.2F : 1.0F;
    out.g = health == Health::kOk ? 0.8F : health == Health::kDegenerate ? 0.6F : 0.1F;
    out.b = 0.1F;
    return out;
}

visualization_msgs::Marker marker(const ScanResult& r, const std::string& frame, const char* space,
                                  int id, int type) {
    visualization_msgs::Marker m;
    m.header.stamp = to_time(r.stamp);
    m.header.frame_id = frame;
    m.ns = space;
    m.id = id;
    m.type = type;
    m.action = visualization_msgs::Marker::ADD;
    m.pose.orientation.w = 1.0;
    return m;
}

constexpr double kArrow = 3.0;        // m, half the length of a weak direction
constexpr double kLongestAxis = 4.0;  // m, of the ellipsoid

visualization_msgs::Marker arrow(const ScanResult& r, const std::string& frame, const char* space,
                                 int id, const Vec3& direction) {
    auto m = marker(r, frame, space, id, visualization_msgs::Marker::ARROW);
    m.points = {to_xyz<geometry_msgs::Point>(r.state.pos - kArrow * direction),
                to_xyz<geometry_msgs::Point>(r.state.pos + kArrow * direction)};
    m.scale.x = 0.12;
    m.scale.y = 0.3;
    m.scale.z = 0.4;
    m.color = colour(Health::kLost, 0.9F);
    if (space == std::string("weak_rotation")) m.color.b = 0.9F;
    return m;
}

/// An arrow per weak direction; those that are not weak any more are taken away.
void add_arrows(const ScanResult& r, const std::string& frame,
                visualization_msgs::MarkerArray& out) {
    const ScanDiagnostics& d = r.diagnostics;
    for (int i = 0; i < 3; ++i) {
        const Vec3 t = d.v_t.col(i), turn = r.state.rot * d.v_r.col(i);
        out.markers.push_back(arrow(r, frame, "weak_translation", i, t));
        if (i >= d.weak_t || !t.allFinite()) {
            out.markers.back().action = visualization_msgs::Marker::DELETE;
        }
        out.markers.push_back(arrow(r, frame, "weak_rotation", i, turn));
        if (i >= d.weak_r || !turn.allFinite()) {
            out.markers.back().action = visualization_msgs::Marker::DELETE;
        }
    }
}

/// Axes go with 1/sqrt(eigenvalue), the standard deviation up to a common factor.
visualization_msgs::Marker ellipsoid(const ScanResult& r, const std::string& frame) {
    auto m = marker(r, frame, "information", 0, visualization_msgs::Marker::SPHERE);
    const ScanDiagnostics& d = r.diagnostics;
    if (!d.lambda_t.allFinite() || !d.v_t.allFinite() || !(d.lambda_t[0] > 0.0)) {
        m.action = visualization_msgs::Marker::DELETE;
        return m;
    }
    Mat3 axes = d.v_t;
    if (axes.determinant() < 0.0) axes.col(2) = -axes.col(2);
    m.pose.position = to_xyz<geometry_msgs::Point>(r.state.pos);
    m.pose.orientation = to_quaternion(axes);
    const auto length = [&d](int i) {
        return kLongestAxis * std::sqrt(d.lambda_t[0] / d.lambda_t[i]);
    };
    m.scale.x = length(0);
    m.scale.y = length(1);
    m.scale.z = length(2);
    m.color = colour(r.health, 0.35F);
    return m;
}

visualization_msgs::Marker label(const ScanResult& r, const std::string& frame) {
    auto m = marker(r, frame, "health", 0, visualization_msgs::Marker::TEXT_VIEW_FACING);
    m.pose.position = to_xyz<geometry_msgs::Point>(r.state.pos + Vec3(0, 0, 2.5));
    m.scale.z = 0.8;
    m.color = colour(r.health, 1.0F);
    char text[96];
    std::snprintf(text, sizeof text, "%s  lambda_t %.0f %.0f %.0f", to_string(r.health),
                  r.diagnostics.lambda_t[0], r.diagnostics.lambda_t[1], r.diagnostics.lambda_t[2]);
    m.text = r.diagnostics.lambda_t.allFinite() ? text : to_string(r.health);
    return m;
}

}  // namespace

ros::Time to_time(Stamp stamp) {
    const Stamp sec = stamp / 1'000'000'000;
    if (stamp < 0 || sec > std::numeric_limits<std::uint32_t>::max()) return {};
    return {static_cast<std::uint32_t>(sec), static_cast<std::uint32_t>(stamp % 1'000'000'000)};
}

nav_msgs::Odometry to_odometry(const ScanResult& r, const Frames& frames, const Vec3& gyro) {
    nav_msgs::Odometry out;
    out.header.stamp = to_time(r.stamp);
    out.header.frame_id = frames.map;
    out.child_frame_id = frames.body;
    out.pose.pose.position = to_xyz<geometry_msgs::Point>(r.state.pos);
    out.pose.pose.orientation = to_quaternion(r.state.rot);
    for (int i = 0; i < 36; ++i) {
        out.pose.covariance[static_cast<std::size_t>(i)] = r.covariance(i / 6, i % 6);
    }
    out.twist.twist.linear = to_xyz<geometry_msgs::Vector3>(r.state.rot.transpose() * r.state.vel);
    out.twist.twist.angular = to_xyz<geometry_msgs::Vector3>(gyro - r.state.gyro_bias);
    return out;
}

geometry_msgs::PoseStamped to_pose(const Pose& T, Stamp stamp, const std::string& frame) {
    geometry_msgs::PoseStamped out;
    out.header.stamp = to_time(stamp);
    out.header.frame_id = frame;
    out.pose.position = to_xyz<geometry_msgs::Point>(T.t);
    out.pose.orientation = to_quaternion(T.R);
    return out;
}

geometry_msgs::TransformStamped to_transform(const ScanResult& r, const Frames& frames) {
    geometry_msgs::TransformStamped out;
    out.header.stamp = to_time(r.stamp);
    out.header.frame_id = frames.map;
    out.child_frame_id = frames.body;
    out.transform.translation = to_xyz<geometry_msgs::Vector3>(r.state.pos);
    out.transform.rotation = to_quaternion(r.state.rot);
    return out;
}

diagnostic_msgs::DiagnosticStatus to_status(const ScanResult& r, const std::string& node,
                                            const std::string& host) {
    using Status = diagnostic_msgs::DiagnosticStatus;
    Status out;
    out.name = node + ": scan";
    out.hardware_id = host;
    const bool fault = r.health == Health::kLost || r.status == ScanStatus::kImuFault;
    const bool warn = r.health == Health::kDegenerate || r.status == ScanStatus::kReset;
    out.level = fault ? Status::ERROR : warn ? Status::WARN : Status::OK;
    out.message = to_string(r.status);
    if (r.health != Health::kOk) out.message += std::string(", ") + to_string(r.health);
    if (!r.message.empty()) out.message += ": " + r.message;
    return out;
}

visualization_msgs::MarkerArray to_markers(const ScanResult& r, const std::string& frame) {
    visualization_msgs::MarkerArray out;
    add_arrows(r, frame, out);
    out.markers.push_back(ellipsoid(r, frame));
    out.markers.push_back(label(r, frame));
    return out;
}

}  // namespace d2lio::ros1
