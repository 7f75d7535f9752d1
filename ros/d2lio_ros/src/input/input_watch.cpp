// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/input_watch.hpp"

#include <cmath>
#include <cstdio>

namespace d2lio::ros1 {
namespace {

constexpr double kSilence = 1.0;  // s without a message
constexpr double kAtStart = 5.0;  // s until the first one
constexpr double kApart = 10.0;   // s; no driver delays one stream against the other by this much

double seconds(std::chrono::steady_clock::duration d) {
    return std::chrono::duration<double>(d).count();
}

}  // namespace

InputWatch::InputWatch(std::string lidar_topic, std::string imu_topic) {
    lidar_.topic = std::move(lidar_topic);
    imu_.topic = std::move(imu_topic);
}

void InputWatch::Stream::see(Stamp stamp, Clock::time_point arrival) {
    if (!first_arrival) {
        first_arrival = arrival;
        first = stamp;
    }
    last_arrival = arrival;
}

std::string InputWatch::Stream::silence(Clock::time_point now, Clock::time_point since) const {
    const double age = seconds(now - last_arrival.value_or(since));
    if (age <= (last_arrival ? kSilence : kAtStart)) return {};
    char text[32];
    std::snprintf(text, sizeof text, "%.1f s", age);
    return "no message on " + topic + " for " + text;
}

void InputWatch::imu(Stamp stamp, Clock::time_point arrival) {
    const std::lock_guard<std::mutex> lock(mutex_);
    imu_.see(stamp, arrival);
}

void InputWatch::scan(Stamp stamp, Clock::time_point arrival) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lidar_.see(stamp, arrival);
}

std::string InputWatch::complaint(Clock::time_point now) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (lidar_.first_arrival && imu_.first_arrival) {
        const double lead = seconds(*imu_.first_arrival - *lidar_.first_arrival);
        const double apart = seconds_between(imu_.first, lidar_.first) - lead;
        if (std::abs(apart) > kApart) {
            char text[160];
            std::snprintf(
                text, sizeof text,
                "IMU and LiDAR stamps come from different clocks: %.3f s on %s, %.3f s on %s",
                seconds_between(imu_.first, 0), imu_.topic.c_str(),
                seconds_between(lidar_.first, 0), lidar_.topic.c_str());
            return text;
        }
    }
    const std::string lidar = lidar_.silence(now, begin_), imu = imu_.silence(now, begin_);
    return lidar + (lidar.empty() || imu.empty() ? "" : "; ") + imu;
}

}  // namespace d2lio::ros1
