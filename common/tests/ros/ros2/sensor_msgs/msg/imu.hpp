// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

namespace sensor_msgs {
namespace msg {

struct Imu {
    using ConstSharedPtr = std::shared_ptr<const Imu>;
    struct {
        struct {
            std::int32_t sec = 0;
            std::uint32_t nanosec = 0;
        } stamp;
    } header;
    struct {
        double x, y, z;
    } linear_acceleration, angular_velocity;
};

}  // namespace msg
}  // namespace sensor_msgs
