// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <rclcpp/rclcpp.hpp>
#include <string>

#include "standin/node.h"
#include "standin/room.h"

/// What the mapping node knows about itself.
class ParamServer : public standin::Node {
  public:
    ParamServer(int argc, char** argv) : standin::Node(argc, argv) {}
    standin::Node& host() { return *this; }
    sensor_msgs::msg::Imu imuConverter(const sensor_msgs::msg::Imu& imu) const { return imu; }

    std::string imuTopic = "imu";
    float mappingSurfLeafSize = 0.3F;  // m
    float imuAccNoise = 4e-3F, imuGyrNoise = 1.6e-3F, imuAccBiasN = 6e-5F, imuGyrBiasN = 4e-5F;
    float imuGravity = static_cast<float>(standin::kGravity);
};
