// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/ros.h>

#include <string>

#include "standin/node.h"
#include "standin/room.h"

/// What the mapping node knows about itself.
class ParamServer {
  public:
    ParamServer(int argc, char** argv) : nh(argc, argv) {}
    standin::Node& host() { return nh; }
    sensor_msgs::Imu imuConverter(const sensor_msgs::Imu& imu) const { return imu; }

    standin::Node nh;
    std::string imuTopic = "imu";
    float mappingSurfLeafSize = 0.3F;  // m
    float imuAccNoise = 4e-3F, imuGyrNoise = 1.6e-3F, imuAccBiasN = 6e-5F, imuGyrBiasN = 4e-5F;
    float imuGravity = static_cast<float>(standin::kGravity);
};
