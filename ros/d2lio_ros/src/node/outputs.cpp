// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/outputs.hpp"

#include "d2lio/ros1/text.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::uint32_t kQueue = 100;                    // messages that a slow listener may lag
constexpr std::size_t kMostPoses = 4000;                 // of a path; beyond, every other one stays
constexpr std::chrono::milliseconds kPathInterval{500};  // it is sent whole every time

constexpr char kAllDiagnostics[] = "/diagnostics";

diagnostic_msgs::KeyValue key_value(const std::string& key, const std::string& value) {
    diagnostic_msgs::KeyValue out;
    out.key = key;
    out.value = value;
    return out;
}

}  // namespace

Outputs::Outputs(ros::NodeHandle& node, const Configuration& config, std::string node_name)
    : frames_{config.node.map_frame, config.node.body_frame},
      name_(std::move(node_name)),
      host_(config.kind->name),
      blind_(config.source.min_range_m),
      map_period_(config.node.map_period),
      odometry_(node.advertise<nav_msgs::Odometry>("odometry", kQueue)),
      path_(node.advertise<nav_msgs::Path>("path", 1, true)),
      cloud_(node.advertise<sensor_msgs::PointCloud2>("cloud_registered", kQueue)),
      map_(node.advertise<sensor_msgs::PointCloud2>("map", 1, true)),
      diagnostics_(node.advertise<diagnostic_msgs::DiagnosticArray>("diagnostics", kQueue)),
      markers_(node.advertise<visualization_msgs::MarkerArray>("markers", kQueue)),
      rejected_(node.advertise<sensor_msgs::PointCloud2>("rejected", kQueue)) {
    // In the root namespace both are one topic.
    if (diagnostics_.getTopic() != kAllDiagnostics) {
        all_diagnostics_ =
            node.advertise<diagnostic_msgs::DiagnosticArray>(kAllDiagnostics, kQueue);
    }
    if (config.node.publish_tf) transforms_ = std::make_unique<tf2_ros::TransformBroadcaster>();
    path_message_.header.frame_id = frames_.map;
}

void Outputs::publish(const ScanResult& result, const ResultContext& context) {
    if (result.new_epoch) forget_path();
    if (result.has_pose) {
        publish_pose(result, context);
        publish_path(result);
        if (context.scan != nullptr) publish_cloud(result, *context.scan);
        if (markers_.getNumSubscribers() > 0) markers_.publish(to_markers(result, frames_.map));
        previous_ = TimedPose{result.stamp, result.state.T_map_imu()};
    }
    publish_diagnostics(result, context);
}

void Outputs::publish_pose(const ScanResult& result, const ResultContext& context) {
    odometry_.publish(to_odometry(result, frames_, context.gyro));
    if (transforms_) transforms_->sendTransform(to_transform(result, frames_));
}

void Outputs::publish_path(const ScanResult& result) {
    if (path_seen_++ % path_stride_ == 0) {
        path_message_.poses.push_back(to_pose(result.state.T_map_imu(), result.stamp, frames_.map));
    }
    if (path_message_.poses.size() > kMostPoses) {
        auto& poses = path_message_.poses;
        for (std::size_t i = 1; 2 * i < poses.size(); ++i) poses[i] = poses[2 * i];
        poses.resize((poses.size() + 1) / 2);
        path_stride_ *= 2;
    }
    const auto now = std::chrono::steady_clock::now();
    if (now - path_published_ < kPathInterval) return;
    path_published_ = now;
    path_message_.header.stamp = to_time(result.stamp);
    path_.publish(path_message_);
}

void Outputs::forget_path() {
    path_message_.poses.clear();
    path_stride_ = 1;
    path_seen_ = 0;
    previous_.reset();
}

void Outputs::publish_cloud(const ScanResult& result, const Scan& scan) {
    const Pose now = result.state.T_map_imu();
    const TimedPose before = previous_.value_or(TimedPose{result.stamp, now});
    cloud_.publish(to_cloud(registered(scan, before.pose, before.stamp, now, result.stamp,
                                       result.state.T_imu_lidar(), blind_),
                            result.stamp, frames_.map));
}

void Outputs::publish_points(const std::optional<ScanPoints>& points, Stamp stamp) {
    if (points) rejected_.publish(to_rejected(*points, stamp, frames_.map));
}

void Outputs::publish_diagnostics(const ScanResult& result, const ResultContext& context) {
    diagnostic_msgs::DiagnosticArray array;
    array.header.stamp = to_time(result.stamp);
    diagnostic_msgs::DiagnosticStatus status = to_status(result, name_, host_);
    for (const auto& [name, value] : diagnostics_row(result)) {
        status.values.push_back(key_value(name, value));
    }
    status.values.push_back(key_value("latency_ms", shortest(context.latency_ms)));
    status.values.push_back(key_value("queue", std::to_string(context.queue)));
    status.values.push_back(key_value("dropped", std::to_string(context.dropped)));
    array.status.push_back(std::move(status));
    publish_status(array);
}

void Outputs::publish_status(const diagnostic_msgs::DiagnosticArray& array) {
    diagnostics_.publish(array);
    if (all_diagnostics_) all_diagnostics_.publish(array);
}

void Outputs::input_status(std::uint8_t level, const std::string& message,
                           const std::map<std::string, std::size_t>& counts) {
    diagnostic_msgs::DiagnosticArray array;
    array.header.stamp = ros::Time::now();
    diagnostic_msgs::DiagnosticStatus status;
    status.level = level;
    status.name = name_ + ": input";
    status.hardware_id = host_;
    status.message = message;
    for (const auto& [name, value] : counts) {
        status.values.push_back(key_value(name, std::to_string(value)));
    }
    array.status.push_back(std::move(status));
    publish_status(array);
}

bool Outputs::map_due() const {
    const std::chrono::duration<double> age = std::chrono::steady_clock::now() - map_published_;
    return map_period_ > 0.0 && age.count() >= map_period_;
}

void Outputs::publish_map(const std::vector<Eigen::Vector3f>& points) {
    map_published_ = std::chrono::steady_clock::now();
    map_.publish(to_cloud(points, previous_ ? previous_->stamp : 0, frames_.map));
}

}  // namespace d2lio::ros1
