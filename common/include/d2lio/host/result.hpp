// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/geometry/state.hpp"

namespace d2lio {

/// What the host did with a scan.
enum class ScanStatus {
    kOk,                ///< estimate updated
    kDropped,           ///< first scan, as FAST-LIO2
    kInitialising,      ///< gravity and gyroscope bias are being averaged
    kMapInitialised,    ///< this scan became the map
    kTooFewPoints,      ///< pose is the prediction
    kNoCorrespondence,  ///< all points rejected: pose is the prediction, covariance has grown
    kNumericalFailure,  ///< the update was not finite and was refused: pose is the prediction
    kSkipped,           ///< too soon after the last one (mapping interval): no pose
    kImuFault,          ///< readings that no start can be made from
    kReset,  ///< stamps jumped back, a gap beyond its bound, or a filter beyond repair: new epoch
};
const char* to_string(ScanStatus status);

/// Wall time per stage of one scan, ms.
struct StageTimes {
    double preprocess = 0, deskew = 0, downsample = 0, search = 0, update = 0, map = 0, total = 0;
};

struct ScanResult {
    Stamp stamp = 0;  ///< scan end: the time of the pose
    ScanStatus status = ScanStatus::kDropped;
    Health health = Health::kInit;
    std::string message;  ///< one line where something is wrong
    /// State and covariance mean something. True from the scan on that became the map, whose pose
    /// is the prediction; FAST-LIO2 publishes from the next one.
    bool has_pose = false;
    bool new_epoch = false;  ///< the map and the frame began anew with this scan
    double imu_gap_s = 0.0, lidar_gap_s = 0.0;
    NavState state;
    /// Pose covariance in ROS order (x y z, rx ry rz), map frame, m^2 and rad^2.
    Mat6 covariance = Mat6::Zero();
    ScanDiagnostics diagnostics;
    std::size_t points_raw = 0, points_valid = 0, points_downsampled = 0, map_points = 0;
    StageTimes times;

    /// Every figure of the scan, by column, for CSV files and reports.
    std::vector<std::pair<std::string, double>> columns() const;
};

/// Adds one line to the result's message.
void say(ScanResult& result, const std::string& text);

}  // namespace d2lio
