// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <string>

#include "d2lio/types.hpp"

namespace d2lio::ros1 {

/// Tells which topic is silent, and clocks that never meet. Thread-safe.
class InputWatch {
  public:
    using Clock = std::chrono::steady_clock;

    InputWatch(std::string lidar_topic, std::string imu_topic);
    void imu(Stamp stamp, Clock::time_point arrival);
    void scan(Stamp stamp, Clock::time_point arrival);
    /// One line where something is missing; empty if both topics flow.
    std::string complaint(Clock::time_point now) const;

  private:
    struct Stream {
        std::string topic;
        std::optional<Clock::time_point> first_arrival, last_arrival;
        Stamp first = 0;
        void see(Stamp stamp, Clock::time_point arrival);
        std::string silence(Clock::time_point now, Clock::time_point since) const;
    };
    mutable std::mutex mutex_;
    Stream lidar_, imu_;
    Clock::time_point begin_ = Clock::now();
};

}  // namespace d2lio::ros1
