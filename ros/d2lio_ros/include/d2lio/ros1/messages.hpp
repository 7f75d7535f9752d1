// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "d2lio/host/result.hpp"
#include "d2lio/ros1/estimator.hpp"
#include "d2lio/types.hpp"

/// Results of a scan as ROS messages.
namespace d2lio::ros1 {

struct Frames {
    std::string map, body;
};

/// Nanoseconds to ROS's 32-bit seconds; what does not fit becomes the zero time.
ros::Time to_time(Stamp stamp);

/// Pose with the covariance of this scan (x y z, rx ry rz, map axes); twist in the body frame.
/// @param gyro newest reading, rad/s
nav_msgs::Odometry to_odometry(const ScanResult& result, const Frames& frames, const Vec3& gyro);
geometry_msgs::PoseStamped to_pose(const Pose& T_map_imu, Stamp stamp, const std::string& frame);
geometry_msgs::TransformStamped to_transform(const ScanResult& result, const Frames& frames);

/// x y z (float32).
sensor_msgs::PointCloud2 to_cloud(const std::vector<Eigen::Vector3f>& points, Stamp stamp,
                                  const std::string& frame);
/// x y z intensity: a scan's points in the map.
sensor_msgs::PointCloud2 to_cloud(const std::vector<LidarPoint>& points, Stamp stamp,
                                  const std::string& frame);
/// x y z rgb reason (uint8, the Verdict): what the estimator did not use.
sensor_msgs::PointCloud2 to_rejected(const ScanPoints& scan, Stamp stamp, const std::string& frame);
/// Colour of a reason, 0xRRGGBB.
std::uint32_t colour_of(Verdict verdict);

/// Level and message of a scan's status; its values are added by the caller.
diagnostic_msgs::DiagnosticStatus to_status(const ScanResult& result, const std::string& node,
                                            const std::string& host);

/// Arrows along weak directions and the ellipsoid of the translation's uncertainty, its longest
/// axis along the weakest direction; a text with health and eigenvalues.
visualization_msgs::MarkerArray to_markers(const ScanResult& result, const std::string& frame);

/// The scan moved into the map, de-skewed for display: the pose runs evenly from one scan's end to
/// the next one's.
/// @param blind nearer points are left out, m
std::vector<LidarPoint> registered(const Scan& scan, const Pose& previous, Stamp previous_stamp,
                                   const Pose& current, Stamp stamp, const Pose& T_imu_lidar,
                                   double blind);

/// Points as a binary PCD file.
std::string to_pcd(const std::vector<Eigen::Vector3f>& points);

}  // namespace d2lio::ros1
