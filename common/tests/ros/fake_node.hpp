// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#if D2LIO_ROS == 1
#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#else
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/imu.hpp>
#endif

/// One face for the stand-ins of both ROS versions.
namespace d2lio::test {

#if D2LIO_ROS == 1
using Node = ros::NodeHandle;
using Value = XmlRpc::XmlRpcValue;
using Diagnostics = diagnostic_msgs::DiagnosticArray;
using Imu = sensor_msgs::Imu;

inline void set_absolute(Node& node, const std::string& name, const Value& value) {
    node.parameters["/robot/" + name] = value;
}
inline double stamp_of(const Diagnostics& m) { return m.header.stamp.toSec(); }
inline void set_stamp(Imu& m, double t) { m.header.stamp.fromSec(t); }
#else
using Node = rclcpp::Node;
using Value = rclcpp::ParameterValue;
using Diagnostics = diagnostic_msgs::msg::DiagnosticArray;
using Imu = sensor_msgs::msg::Imu;

inline void set_absolute(Node& node, std::string name, const Value& value) {
    for (char& c : name) c = c == '/' ? '.' : c;
    node.overrides[name] = value;
}
inline double stamp_of(const Diagnostics& m) {
    return m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec;
}
inline void set_stamp(Imu& m, double t) {
    m.header.stamp.sec = static_cast<std::int32_t>(t);
    m.header.stamp.nanosec = static_cast<std::uint32_t>((t - m.header.stamp.sec) * 1e9);
}
#endif

/// @param name with slashes, below d2lio/.
inline void set(Node& node, const std::string& name, const Value& value) {
    set_absolute(node, "d2lio/" + name, value);
}

/// What went out on the advertised topic.
inline std::vector<std::pair<std::string, Diagnostics>> published(const Node& node) {
    using Log = std::vector<std::pair<std::string, Diagnostics>>;
    return node.log ? *static_cast<const Log*>(node.log.get()) : Log();
}

/// Hands a sample to the subscriber.
inline void deliver(const Node& node, double stamp, double ax, double ay, double az) {
    auto message = std::make_shared<Imu>();
    set_stamp(*message, stamp);
    message->linear_acceleration = {ax, ay, az};
    message->angular_velocity = {0.0, 0.0, 0.0};
#if D2LIO_ROS == 1
    using Callback = std::function<void(const sensor_msgs::ImuConstPtr&)>;
#else
    using Callback = std::function<void(Imu::ConstSharedPtr)>;
#endif
    (*static_cast<const Callback*>(node.callback.get()))(message);
}

}  // namespace d2lio::test
