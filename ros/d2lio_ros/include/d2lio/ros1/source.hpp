// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "d2lio/config/params.hpp"
#include "d2lio/host/configure.hpp"
#include "d2lio/preprocess/point_times.hpp"
#include "d2lio/ros1/settings.hpp"

namespace d2lio::ros1 {

/// The sensors, as a sequence.yaml or the configuration file of `d2lio run --config` describes
/// them. Keys and defaults are the same; docs/DATASETS.md explains them.
struct Source {
    std::string name, lidar_topic, imu_topic, time_field, model;
    double T_imu_lidar[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};  ///< by rows, m
    int rings = 0;                                                              ///< 0: unknown
    int columns = 0;  ///< of a turn; 0: those of the model
    double rate_hz = 10.0;
    double min_range_m = 0.5, max_range_m = 100.0;
    TimeUnit time_unit = TimeUnit::kAuto;
    TimeReference time_reference = TimeReference::kAuto;
    bool synchronised = false, pseudo_times = false;
    enum class AccelUnit { kSi, kG } accel_unit = AccelUnit::kSi;
    bool orientation = true;
    double imu_rate_hz = 200.0;
    std::set<std::string> stated;  ///< keys that were set

    Settings host;  ///< estimator parameters of a configuration file

    void bind(ParamTable& table);
    static const std::set<std::string>& text_keys();
    void set_text(const std::string& key, const std::string& value);
    /// What a file leaves open once all its keys are known. @throws ConfigError
    void complete(bool is_sequence);

    PointTimeHint time_hint() const;
    double accel_scale() const;
};

/// Takes out of `settings` what describes the source; bad values are added to the problems.
/// @param where put before keys in messages
void take_source(Settings& settings, Source& source, const std::string& where, Problems& problems);

/// Reads a sequence.yaml or a configuration file.
/// @param host estimator whose section under `hosts` counts
void read_source_file(const std::string& path, const std::string& host, Source& source,
                      Problems& problems);

/// Estimator parameters that follow from the source, with `own` on top.
/// @param host fastlio, liosam or d2lio
/// @param own parameters that the user sets
ParamMap source_params(const Source& source, const std::string& host, const ParamMap& own);

}  // namespace d2lio::ros1
