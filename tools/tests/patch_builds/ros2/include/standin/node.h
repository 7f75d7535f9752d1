// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/imu.hpp>
#include <string>

#include "standin/arguments.h"

namespace standin {

using ImuMessage = sensor_msgs::msg::Imu;

inline void set_stamp(ImuMessage& message, double t) {
    message.header.stamp.sec = static_cast<std::int32_t>(t);
    message.header.stamp.nanosec = static_cast<std::uint32_t>((t - message.header.stamp.sec) * 1e9);
}

/// A node whose parameters are the command line's; slashes in their names become dots.
class Node : public rclcpp::Node {
  public:
    Node(int argc, char** argv) {
        read_arguments<rclcpp::ParameterValue>(
            argc, argv, [this](std::string key, const rclcpp::ParameterValue& value) {
                for (char& c : key) c = c == '/' ? '.' : c;
                overrides[key] = value;
            });
    }
    ~Node() {
        for (const std::string& topic : advertised) {
            std::fprintf(stderr, "advertised %s\n", topic.c_str());
        }
    }
    /// Nothing but d2lio. is ever set.
    template <class T>
    void get_parameter_or(const std::string&, T& out, const T& otherwise) const {
        out = otherwise;
    }
    void deliver(const ImuMessage& message) const {
        using Callback = std::function<void(ImuMessage::ConstSharedPtr)>;
        if (!callback) return;
        (*static_cast<const Callback*>(callback.get()))(std::make_shared<ImuMessage>(message));
    }
};

}  // namespace standin
