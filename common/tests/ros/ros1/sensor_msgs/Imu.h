// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/ros.h>

#include <memory>

namespace sensor_msgs {

struct Imu {
    struct {
        ros::Time stamp;
    } header;
    struct {
        double x, y, z;
    } linear_acceleration, angular_velocity;
};
using ImuConstPtr = std::shared_ptr<const Imu>;

}  // namespace sensor_msgs
