// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace diagnostic_msgs {
namespace msg {

struct KeyValue {
    std::string key, value;
};
struct DiagnosticStatus {
    enum : unsigned char { OK = 0, WARN = 1, ERROR = 2 };
    unsigned char level = OK;
    std::string name, message, hardware_id;
    std::vector<KeyValue> values;
};
struct DiagnosticArray {
    struct {
        struct {
            std::int32_t sec = 0;
            std::uint32_t nanosec = 0;
        } stamp;
    } header;
    std::vector<DiagnosticStatus> status;
};

}  // namespace msg
}  // namespace diagnostic_msgs
