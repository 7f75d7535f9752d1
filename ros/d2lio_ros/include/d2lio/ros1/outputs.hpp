// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <nav_msgs/Path.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2_ros/transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "d2lio/ros1/messages.hpp"
#include "d2lio/ros1/worker.hpp"

namespace d2lio::ros1 {

/// Everything a node publishes. Used by the estimation thread, but for input_status().
class Outputs {
  public:
    Outputs(ros::NodeHandle& node, const Configuration& config, std::string node_name);

    void publish(const ScanResult& result, const ResultContext& context);
    void publish_map(const std::vector<Eigen::Vector3f>& points);
    /// Whether anybody looks at clouds that need the scan's own points.
    bool wants_scans() const { return cloud_.getNumSubscribers() > 0; }
    bool map_due() const;
    void publish_points(const std::optional<ScanPoints>& points, Stamp stamp);
    bool wants_points() const { return rejected_.getNumSubscribers() > 0; }
    /// What reaches the node and what becomes of it; any thread.
    void input_status(std::uint8_t level, const std::string& message,
                      const std::map<std::string, std::size_t>& counts);
    void forget_path();

  private:
    void publish_pose(const ScanResult& result, const ResultContext& context);
    void publish_path(const ScanResult& result);
    void publish_cloud(const ScanResult& result, const Scan& scan);
    void publish_diagnostics(const ScanResult& result, const ResultContext& context);
    void publish_status(const diagnostic_msgs::DiagnosticArray& array);

    Frames frames_;
    std::string name_, host_;
    double blind_;
    double map_period_;
    ros::Publisher odometry_, path_, cloud_, map_, diagnostics_, markers_, rejected_;
    ros::Publisher all_diagnostics_;  ///< none where `diagnostics_` is the same topic
    std::unique_ptr<tf2_ros::TransformBroadcaster> transforms_;
    nav_msgs::Path path_message_;
    std::size_t path_stride_ = 1, path_seen_ = 0;
    std::chrono::steady_clock::time_point path_published_, map_published_;
    std::optional<TimedPose> previous_;
};

}  // namespace d2lio::ros1
