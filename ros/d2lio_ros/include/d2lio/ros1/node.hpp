// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <d2lio_ros/SaveFile.h>
#include <d2lio_ros/SetMode.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <std_srvs/Trigger.h>
#include <topic_tools/shape_shifter.h>

#include <memory>
#include <string>
#include <vector>

#include "d2lio/ros1/input_watch.hpp"
#include "d2lio/ros1/outputs.hpp"
#include "d2lio/ros1/worker.hpp"

namespace d2lio::ros1 {

/// An odometry node around one estimator: subscribes, hands to the worker, publishes, serves.
class Node {
  public:
    /// @param config whole; must outlive the node
    Node(Configuration& config, Recorder& recorder);
    ~Node();

    void start();
    /// Processes what is queued, saves, and publishes the last results.
    void stop();

  private:
    using Message = topic_tools::ShapeShifter;
    template <typename F>
    void guarded(const F& f);
    void on_imu(const Message::ConstPtr& message);
    void on_cloud(const Message::ConstPtr& message);
    void on_result(const ScanResult& result, const ResultContext& context);
    void on_timer();
    void take_imu(const Message& message);
    void take_cloud(const Message& message);
    void tell_input();
    using SaveFile = d2lio_ros::SaveFile;
    using SetMode = d2lio_ros::SetMode;
    bool save_map(SaveFile::Request& request, SaveFile::Response& response);
    bool save_trajectory(SaveFile::Request& request, SaveFile::Response& response);
    bool set_mode(SetMode::Request& request, SetMode::Response& response);
    bool reset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
    bool publish_map(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
    template <typename Response, typename F>
    bool serve(Response& response, const F& f);
    std::string target(const std::string& path, const char* file) const;
    RunSummary summary() const;
    bool right_lidar_type(const std::string& type);

    Configuration& config_;
    Recorder& recorder_;
    Complaints complaints_;
    Worker worker_;
    InputWatch watch_;
    ros::NodeHandle nh_, private_;
    ros::CallbackQueue service_queue_;
    ros::NodeHandle services_;
    Outputs outputs_;
    std::vector<ros::Subscriber> subscribers_;
    std::vector<ros::ServiceServer> servers_;
    ros::WallTimer timer_;
    ros::AsyncSpinner spinner_, service_spinner_;
    Clock::time_point begin_ = Clock::now();
    std::size_t dropped_ = 0;  ///< scans, as of the last tick
    bool stopped_ = false;
};

/// main() of a node: exit code 0 after a signal or shutdown, 1 where the parameters are wrong, with
/// one message that lists them all.
/// @param kinds estimators, the default first
int run_node(int argc, char** argv, const std::string& name, std::vector<EstimatorKind> kinds);

}  // namespace d2lio::ros1
