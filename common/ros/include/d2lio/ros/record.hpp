// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "d2lio/plugin/plugin.hpp"
#include "d2lio/ros/settings.hpp"

#if D2LIO_ROS == 1
#include <ros/ros.h>
#endif
#ifdef D2LIO_WITH_DIAGNOSTIC_MSGS
#if D2LIO_ROS == 1
#include <diagnostic_msgs/DiagnosticArray.h>
#else
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#endif
#endif

namespace d2lio {
namespace ros_glue {

/// ROS objects that a static plug-in must not destroy: it outlives what they belong to.
inline void keep_for_ever(std::shared_ptr<void> object) {
    static auto& kept = *new std::vector<std::shared_ptr<void>>;
    kept.push_back(std::move(object));
}

/// The diagnostics of one scan: stamp and the plug-in's columns.
struct Record {
    double stamp = 0.0;  ///< s
    std::vector<std::pair<const char*, double>> columns;

    double at(const char* name) const {
        for (const auto& c : columns) {
            if (std::string(c.first) == name) return c.second;
        }
        return std::numeric_limits<double>::quiet_NaN();
    }
    void set(const char* name, double value) {
        for (auto& c : columns) {
            if (std::string(c.first) == name) c.second = value;
        }
    }
};

inline Record last_record(const Plugin& plugin, double stamp) {
    Record out;
    out.stamp = stamp;
    for (std::size_t i = 0; i < plugin.diagnostics_size(); ++i) {
        out.columns.emplace_back(plugin.diagnostics_name(i), plugin.diagnostics_value(i));
    }
    return out;
}

#ifdef D2LIO_WITH_DIAGNOSTIC_MSGS
#if D2LIO_ROS == 1
using DiagnosticArray = diagnostic_msgs::DiagnosticArray;
using DiagnosticStatus = diagnostic_msgs::DiagnosticStatus;
using KeyValue = diagnostic_msgs::KeyValue;
#else
using DiagnosticArray = diagnostic_msgs::msg::DiagnosticArray;
using DiagnosticStatus = diagnostic_msgs::msg::DiagnosticStatus;
using KeyValue = diagnostic_msgs::msg::KeyValue;
#endif

inline void set_stamp(DiagnosticArray& message, double stamp) {
#if D2LIO_ROS == 1
    message.header.stamp.fromSec(stamp);
#else
    message.header.stamp.sec = static_cast<std::int32_t>(std::floor(stamp));
    message.header.stamp.nanosec = static_cast<std::uint32_t>((stamp - std::floor(stamp)) * 1e9);
#endif
}

/// OK; WARN with a weak direction; ERROR without correspondences.
inline DiagnosticArray to_message(const Record& record, const std::string& host) {
    DiagnosticArray message;
    set_stamp(message, record.stamp);
    DiagnosticStatus status;
    status.name = host + ": D2-LIO";
    status.hardware_id = host;
    const double weak = record.at("weak_r") + record.at("weak_t");
    if (!(record.at("accepted") > 0.0)) {
        status.level = DiagnosticStatus::ERROR;
        status.message = "lost: no correspondence";
    } else if (weak > 0.0) {
        status.level = DiagnosticStatus::WARN;
        status.message =
            "degenerate: " + std::to_string(static_cast<int>(weak)) + " weak directions";
    } else {
        status.level = DiagnosticStatus::OK;
        status.message = "every direction constrained";
    }
    for (const auto& column : record.columns) {
        KeyValue value;
        value.key = column.first;
        char text[32];
        std::snprintf(text, sizeof text, "%.9g", column.second);
        value.value = text;
        status.values.push_back(value);
    }
    message.status.push_back(status);
    return message;
}
#endif  // D2LIO_WITH_DIAGNOSTIC_MSGS

/// Writes records to a CSV file and a topic, either of which may be absent.
class Recorder {
  public:
    bool active() const { return csv_.is_open() || publish_; }

    /// @throws std::invalid_argument (through `reader`, at its finish()) for a file that cannot be
    /// written.
    void open_csv(const std::string& path, SettingsReader& reader) {
        if (path.empty()) return;
        csv_.open(path);
        if (!csv_) reader.refuse("diagnostics.csv", path, "a file that can be written");
    }

    template <class Node>
    void advertise(Node& node, const std::string& topic, const std::string& host) {
#ifdef D2LIO_WITH_DIAGNOSTIC_MSGS
        if (topic.empty()) return;
#if D2LIO_ROS == 1
        auto publisher = node.template advertise<DiagnosticArray>(topic, 10);
        using Publisher = decltype(publisher);
        const auto kept = std::make_shared<Publisher>(publisher);
#else
        const auto kept = node.template create_publisher<DiagnosticArray>(topic, 10);
#endif
        keep_for_ever(kept);
        const std::weak_ptr<typename decltype(kept)::element_type> outside = kept;
        publish_ = [outside, host](const Record& record) {
            if (const auto to = outside.lock()) to->publish(to_message(record, host));
        };
#else
        (void)node, (void)topic, (void)host;
#endif
    }

    void write(const Record& record) {
        if (publish_) publish_(record);
        if (!csv_.is_open()) return;
        if (!header_written_) {
            csv_ << "stamp";
            for (const auto& column : record.columns) csv_ << ',' << column.first;
            csv_ << '\n';
            header_written_ = true;
        }
        char text[32];
        std::snprintf(text, sizeof text, "%.9f", record.stamp);
        csv_ << text;
        for (const auto& column : record.columns) {
            std::snprintf(text, sizeof text, ",%.9g", column.second);
            csv_ << text;
        }
        csv_ << std::endl;  // what is written survives a node that is killed
    }

  private:
    std::ofstream csv_;
    bool header_written_ = false;
    std::function<void(const Record&)> publish_;
};

}  // namespace ros_glue
}  // namespace d2lio
