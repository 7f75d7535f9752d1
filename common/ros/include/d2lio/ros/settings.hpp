// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "d2lio/plugin/plugin.hpp"

#if D2LIO_ROS == 1
#include <ros/node_handle.h>
#elif D2LIO_ROS == 2
#include <rclcpp/rclcpp.hpp>
#else
#error "D2LIO_ROS must be 1 or 2"
#endif

/// Parameters of a plug-in out of a ROS node: everything under d2lio/, in YAML as nested mappings
/// (d2lio: {rejection: {mode: kiss}}). C++14, no Eigen. Templates: a node is whatever has
/// ros::NodeHandle's or rclcpp::Node's parameter functions.
namespace d2lio {
namespace ros_glue {

constexpr char kNamespace[] = "d2lio";

/// A parameter as text. YAML takes a bare off, no, on for truth values: `word` is what the user may
/// have meant by one.
struct Setting {
    std::string text, word;
};
/// By dotted key, "rejection.mode".
using Settings = std::map<std::string, Setting>;

inline Setting from_bool(bool value) {
    return value ? Setting{"true", "on"} : Setting{"false", "off"};
}
inline Setting from_double(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", value);
    return {text, text};
}
inline Setting from_text(const std::string& text) { return {text, text}; }

#if D2LIO_ROS == 1

inline Setting from_value(XmlRpc::XmlRpcValue& value) {
    switch (value.getType()) {
        case XmlRpc::XmlRpcValue::TypeBoolean:
            return from_bool(static_cast<bool&>(value));
        case XmlRpc::XmlRpcValue::TypeInt:
            return from_text(std::to_string(static_cast<int&>(value)));
        case XmlRpc::XmlRpcValue::TypeDouble:
            return from_double(static_cast<double&>(value));
        case XmlRpc::XmlRpcValue::TypeString:
            return from_text(static_cast<std::string&>(value));
        default:
            return from_text("(not a single value)");
    }
}

template <class Node>
Settings read_settings(Node& node) {
    Settings settings;
    const std::string root = node.resolveName(kNamespace);
    std::vector<std::string> names;
    node.getParamNames(names);
    for (const std::string& name : names) {
        const bool below = name.compare(0, root.size() + 1, root + "/") == 0;
        XmlRpc::XmlRpcValue value;
        if ((!below && name != root) || !node.getParam(name, value)) continue;
        std::string key = below ? name.substr(root.size() + 1) : std::string();
        for (char& c : key) c = c == '/' ? '.' : c;
        settings[key] = from_value(value);
    }
    return settings;
}

#else

inline Setting from_value(const rclcpp::ParameterValue& value) {
    switch (value.get_type()) {
        case rclcpp::ParameterType::PARAMETER_BOOL:
            return from_bool(value.get<bool>());
        case rclcpp::ParameterType::PARAMETER_INTEGER:
            return from_text(std::to_string(value.get<std::int64_t>()));
        case rclcpp::ParameterType::PARAMETER_DOUBLE:
            return from_double(value.get<double>());
        case rclcpp::ParameterType::PARAMETER_STRING:
            return from_text(value.get<std::string>());
        default:
            return from_text("(not a single value)");
    }
}

/// What was set from outside is declared as well, so that `ros2 param` shows it.
template <class Node>
Settings read_settings(Node& node) {
    Settings settings;
    const std::string root = std::string(kNamespace) + ".";
    for (const auto& item : node.get_node_parameters_interface()->get_parameter_overrides()) {
        const bool below = item.first.compare(0, root.size(), root) == 0;
        if (!below && item.first != kNamespace) continue;
        if (!node.has_parameter(item.first)) node.declare_parameter(item.first, item.second);
        settings[below ? item.first.substr(root.size()) : std::string()] = from_value(item.second);
    }
    return settings;
}

#endif

/// Takes settings one by one, gathers what is wrong, and tells all of it at once.
class SettingsReader {
  public:
    template <class Node>
    explicit SettingsReader(Node& node) : settings_(read_settings(node)) {}

    void read(const std::string& key, bool& out) {
        Setting s;
        if (!take(key, s)) return;
        if (s.text == "true" || s.text == "false") {
            out = s.text == "true";
        } else {
            refuse(key, s.text, "true or false");
        }
    }
    void read(const std::string& key, std::string& out) {
        Setting s;
        if (take(key, s)) out = s.text;
    }
    /// @param least smallest value that is allowed
    void read(const std::string& key, double& out, double least) {
        Setting s;
        if (!take(key, s)) return;
        char* end = nullptr;
        const double value = std::strtod(s.text.c_str(), &end);
        if (end != s.text.c_str() && *end == '\0' && value >= least && value - value == 0.0) {
            out = value;
        } else {
            refuse(key, s.text, "a number >= " + from_double(least).text);
        }
    }
    /// All that is left belongs to the plug-in.
    void finish(Plugin& plugin, const std::vector<std::string>& own_keys) {
        for (const auto& item : settings_) {
            const char* key = item.first.c_str();
            if (plugin.set(key, item.second.text.c_str())) continue;
            const std::string why = plugin.error();
            if (plugin.set(key, item.second.word.c_str())) continue;
            const bool ours = known(plugin, item.first);
            add(item.first, item.second.text, ours ? allowed_part(why) : names(plugin, own_keys));
        }
        settings_.clear();
        if (problems_.empty() && !plugin.check()) problems_ = std::string("\n  ") + plugin.error();
        if (!problems_.empty()) throw std::invalid_argument("D2-LIO cannot start:" + problems_);
    }
    void refuse(const std::string& key, const std::string& value, const std::string& allowed) {
        add(key, value, "allowed: " + allowed);
    }

  private:
    void add(const std::string& key, const std::string& value, const std::string& why) {
        problems_ += "\n  " + path(key) + " = " + value + ": " + why;
    }
    bool take(const std::string& key, Setting& out) {
        const auto found = settings_.find(key);
        if (found == settings_.end()) return false;
        out = found->second;
        settings_.erase(found);
        return true;
    }
    static std::string path(const std::string& key) {
        std::string out = std::string(kNamespace) + (key.empty() ? "" : "/") + key;
        for (char& c : out) c = c == '.' ? '/' : c;
        return out;
    }
    static bool known(const Plugin& plugin, const std::string& key) {
        for (std::size_t i = 0; i < plugin.param_count(); ++i) {
            if (key == plugin.param(i).key) return true;
        }
        return false;
    }
    /// The end of the plug-in's message, which begins with key and value.
    static std::string allowed_part(const std::string& why) {
        const std::size_t at = why.rfind("allowed: ");
        return at == std::string::npos ? why : why.substr(at);
    }
    static std::string names(const Plugin& plugin, const std::vector<std::string>& own_keys) {
        std::string out = "unknown; there are";
        for (std::size_t i = 0; i < plugin.param_count(); ++i)
            out += " " + path(plugin.param(i).key);
        for (const std::string& key : own_keys) out += " " + path(key);
        return out;
    }

    Settings settings_;
    std::string problems_;
};

}  // namespace ros_glue
}  // namespace d2lio
