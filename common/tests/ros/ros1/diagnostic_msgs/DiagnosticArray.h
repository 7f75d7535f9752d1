// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/ros.h>

#include <string>
#include <vector>

namespace diagnostic_msgs {

struct KeyValue {
    std::string key, value;
};
struct DiagnosticStatus {
    enum : signed char { OK = 0, WARN = 1, ERROR = 2 };
    signed char level = OK;
    std::string name, message, hardware_id;
    std::vector<KeyValue> values;
};
struct DiagnosticArray {
    struct {
        ros::Time stamp;
    } header;
    std::vector<DiagnosticStatus> status;
};

}  // namespace diagnostic_msgs
