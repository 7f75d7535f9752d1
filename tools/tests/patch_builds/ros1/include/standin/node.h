// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/ros.h>
#include <sensor_msgs/Imu.h>

#include <cstdio>
#include <string>

#include "standin/arguments.h"

namespace standin {

using ImuMessage = sensor_msgs::Imu;

inline void set_stamp(ImuMessage& message, double t) { message.header.stamp.fromSec(t); }

/// A node handle whose parameters are the command line's.
class Node : public ros::NodeHandle {
  public:
    Node(int argc, char** argv) {
        read_arguments<XmlRpc::XmlRpcValue>(
            argc, argv, [this](const std::string& key, const XmlRpc::XmlRpcValue& value) {
                parameters[resolveName(key)] = value;
            });
    }
    ~Node() {
        for (const std::string& topic : advertised) {
            std::fprintf(stderr, "advertised %s\n", topic.c_str());
        }
    }
    /// Nothing but d2lio/ is ever set.
    template <class T>
    void param(const std::string&, T& out, const T& otherwise) const {
        out = otherwise;
    }
    void deliver(const ImuMessage& message) const {
        using Callback = std::function<void(const sensor_msgs::ImuConstPtr&)>;
        if (!callback) return;
        (*static_cast<const Callback*>(callback.get()))(std::make_shared<ImuMessage>(message));
    }
};

}  // namespace standin
