// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

/// Stand-in for rclcpp: the few functions that the glue calls, with the same names.
namespace rclcpp {

enum ParameterType : std::uint8_t {
    PARAMETER_NOT_SET,
    PARAMETER_BOOL,
    PARAMETER_INTEGER,
    PARAMETER_DOUBLE,
    PARAMETER_STRING,
    PARAMETER_DOUBLE_ARRAY
};

class ParameterValue {
  public:
    ParameterValue() = default;
    ParameterValue(bool v) : type_(PARAMETER_BOOL), bool_(v) {}
    ParameterValue(int v) : type_(PARAMETER_INTEGER), int_(v) {}
    ParameterValue(double v) : type_(PARAMETER_DOUBLE), double_(v) {}
    ParameterValue(const char* v) : type_(PARAMETER_STRING), string_(v) {}
    ParameterValue(const std::vector<double>&) : type_(PARAMETER_DOUBLE_ARRAY) {}
    ParameterType get_type() const { return type_; }
    template <class T>
    T get() const {
        return value(T());
    }

  private:
    bool value(bool) const { return bool_; }
    std::int64_t value(std::int64_t) const { return int_; }
    double value(double) const { return double_; }
    std::string value(const std::string&) const { return string_; }

    ParameterType type_ = PARAMETER_NOT_SET;
    bool bool_ = false;
    std::int64_t int_ = 0;
    double double_ = 0.0;
    std::string string_;
};

struct SensorDataQoS {
    SensorDataQoS& keep_last(std::size_t) { return *this; }
};

template <class Message>
using Log = std::vector<std::pair<std::string, Message>>;

template <class Message>
struct LoggingPublisher {
    std::string topic;
    std::shared_ptr<Log<Message>> log;
    void publish(const Message& message) const { log->emplace_back(topic, message); }
};

class Node {
  public:
    std::map<std::string, ParameterValue> overrides, declared;
    std::vector<std::string> advertised;
    std::shared_ptr<void> log;  ///< Log<Message> of the advertised topic
    std::string subscribed;
    std::shared_ptr<void> callback;  ///< std::function<void(Message::ConstSharedPtr)>

    Node* get_node_parameters_interface() { return this; }
    const std::map<std::string, ParameterValue>& get_parameter_overrides() const {
        return overrides;
    }
    bool has_parameter(const std::string& name) const { return declared.count(name) > 0; }
    void declare_parameter(const std::string& name, const ParameterValue& value) {
        declared[name] = value;
    }
    template <class Message>
    std::shared_ptr<LoggingPublisher<Message>> create_publisher(const std::string& topic, int) {
        advertised.push_back(topic);
        const auto messages = std::make_shared<Log<Message>>();
        log = messages;
        return std::make_shared<LoggingPublisher<Message>>(
            LoggingPublisher<Message>{topic, messages});
    }
    template <class Message, class Callback>
    std::shared_ptr<void> create_subscription(const std::string& topic, const SensorDataQoS&,
                                              Callback&& f) {
        subscribed = topic;
        using Function = std::function<void(std::shared_ptr<const Message>)>;
        callback = std::make_shared<Function>(std::forward<Callback>(f));
        return callback;
    }
};

}  // namespace rclcpp
