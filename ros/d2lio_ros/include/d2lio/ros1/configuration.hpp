// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "d2lio/ros1/decode.hpp"
#include "d2lio/ros1/estimator.hpp"
#include "d2lio/ros1/settings.hpp"
#include "d2lio/ros1/source.hpp"

namespace d2lio::ros1 {

/// The node's own private parameters; docs/TOPICS.md lists them.
struct NodeOptions {
    std::string lidar_topic, imu_topic;  ///< those of the source where empty
    LidarType lidar_type = LidarType::kAuto;
    std::string map_frame = "map", body_frame = "imu";
    bool publish_tf = true;
    int queue_scans = 10;  ///< scans that wait for the estimator, 0: all
    int threads = 1;
    std::string save_dir, results_name, sequence_config;
    double map_period = 0.0;  ///< s, 0: only when asked
    std::string estimator;

    void bind(ParamTable& table);
};

/// A node's configuration, whole or with everything that is wrong with it.
struct Configuration {
    NodeOptions node;
    Source source;
    const EstimatorKind* kind = nullptr;
    ParamMap params;  ///< of the estimator, all that were set
    std::unique_ptr<Estimator> estimator;
    Problems problems;
};

/// Sorts a node's private parameters, checks them all, and makes the estimator.
/// @param settings private parameters, by dotted key
/// @param kinds estimators of this node, the default first; must outlive the result
Configuration configure(Settings settings, const std::vector<EstimatorKind>& kinds);

/// Estimator parameters as texts: a choice takes the word that YAML may have read as a truth value.
ParamMap as_params(const Settings& settings, const EstimatorKind& kind);

}  // namespace d2lio::ros1
