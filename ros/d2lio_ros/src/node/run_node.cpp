// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <xmlrpcpp/XmlRpcValue.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>

#include "d2lio/ros1/node.hpp"
#include "d2lio/ros1/text.hpp"

namespace d2lio::ros1 {
namespace {

// Set by a signal handler, which may do nothing else.
volatile std::sig_atomic_t stop_asked = 0;
void ask_to_stop(int) { stop_asked = 1; }

std::string list_text(XmlRpc::XmlRpcValue& value);

Setting scalar(XmlRpc::XmlRpcValue& value) {
    switch (value.getType()) {
        case XmlRpc::XmlRpcValue::TypeBoolean:
            return Setting::of(static_cast<bool>(static_cast<bool&>(value)));
        case XmlRpc::XmlRpcValue::TypeInt:
            return Setting::of(std::to_string(static_cast<int&>(value)));
        case XmlRpc::XmlRpcValue::TypeDouble:
            return Setting::of(static_cast<double&>(value));
        case XmlRpc::XmlRpcValue::TypeString:
            return Setting::of(static_cast<std::string&>(value));
        case XmlRpc::XmlRpcValue::TypeArray:
            return Setting::of(list_text(value));
        default:
            return Setting::of(std::string("(no single value)"));
    }
}

std::string list_text(XmlRpc::XmlRpcValue& value) {
    std::string out = "[";
    for (int i = 0; i < value.size(); ++i) out += (i > 0 ? ", " : "") + scalar(value[i]).text;
    return out + "]";
}

void flatten(XmlRpc::XmlRpcValue& value, const std::string& prefix, Settings& out) {
    for (auto& [name, member] : value) {
        const std::string key = prefix + (prefix.empty() ? "" : ".") + name;
        if (member.getType() == XmlRpc::XmlRpcValue::TypeStruct) {
            flatten(member, key, out);
        } else {
            out[key] = scalar(member);
        }
    }
}

Settings private_settings() {
    Settings out;
    XmlRpc::XmlRpcValue tree;
    if (ros::param::get(ros::this_node::getName(), tree) &&
        tree.getType() == XmlRpc::XmlRpcValue::TypeStruct) {
        flatten(tree, "", out);
    }
    return out;
}

std::string folder_of(const NodeOptions& node) {
    if (node.save_dir.empty()) return {};
    std::string folder = node.save_dir;
    const char* home = std::getenv("HOME");
    if (folder.rfind("~/", 0) == 0 && home != nullptr) folder = home + folder.substr(1);
    return std::filesystem::absolute(std::filesystem::path(folder) / node.results_name)
        .lexically_normal()
        .string();
}

int run(const std::vector<EstimatorKind>& kinds) {
    Configuration config = configure(private_settings(), kinds);
    Recorder recorder(config.problems.empty() ? folder_of(config.node) : std::string());
    if (!recorder.error().empty())
        config.problems.add("~save_dir", config.node.save_dir, recorder.error());
    if (!config.problems.empty()) {
        ROS_FATAL_STREAM(ros::this_node::getName()
                         << " cannot start, wrong parameters:" << config.problems.text());
        return 1;
    }
    Node node(config, recorder);
    node.start();
    ROS_INFO_STREAM(ros::this_node::getName()
                    << ": " << config.kind->name << " listens to " << config.node.lidar_topic
                    << " and " << config.node.imu_topic);
    while (stop_asked == 0 && ros::ok()) ros::WallDuration(0.02).sleep();
    node.stop();
    return 0;
}

}  // namespace

int run_node(int argc, char** argv, const std::string& name, std::vector<EstimatorKind> kinds) {
    int status = 1;
    try {
        ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
        std::signal(SIGINT, ask_to_stop);
        std::signal(SIGTERM, ask_to_stop);
        ros::NodeHandle keep_running;  // roscpp shuts down with its last handle
        status = run(kinds);
    } catch (const std::exception& e) {
        ROS_FATAL_STREAM(name << " ended: " << e.what());
    }
    ros::shutdown();
    return status;
}

}  // namespace d2lio::ros1
