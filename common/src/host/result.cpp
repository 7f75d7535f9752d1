// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/result.hpp"

namespace d2lio {

const char* to_string(ScanStatus status) {
    switch (status) {
        case ScanStatus::kOk:
            return "ok";
        case ScanStatus::kDropped:
            return "dropped";
        case ScanStatus::kInitialising:
            return "initialising";
        case ScanStatus::kMapInitialised:
            return "map_initialised";
        case ScanStatus::kTooFewPoints:
            return "too_few_points";
        case ScanStatus::kNoCorrespondence:
            return "no_correspondence";
        case ScanStatus::kNumericalFailure:
            return "numerical_failure";
        case ScanStatus::kSkipped:
            return "skipped";
        case ScanStatus::kImuFault:
            return "imu_fault";
        case ScanStatus::kReset:
            break;
    }
    return "reset";
}

void say(ScanResult& r, const std::string& text) {
    if (!text.empty()) r.message += (r.message.empty() ? "" : "; ") + text;
}

std::vector<std::pair<std::string, double>> ScanResult::columns() const {
    std::vector<std::pair<std::string, double>> out{
        {"points_raw", static_cast<double>(points_raw)},
        {"points_valid", static_cast<double>(points_valid)},
        {"points_downsampled", static_cast<double>(points_downsampled)},
    };
    for (auto& c : diagnostics.columns()) out.push_back(std::move(c));
    const auto axis = [&out](const std::string& name, const Vec3& v) {
        const char* const suffix[] = {"_x", "_y", "_z"};
        for (int i = 0; i < 3; ++i) out.emplace_back(name + suffix[i], v[i]);
    };
    axis("velocity", state.vel);
    axis("gyro_bias", state.gyro_bias);
    axis("accel_bias", state.accel_bias);
    axis("gravity", state.gravity);
    for (int i = 0; i < 6; ++i) {
        const char* const names[] = {"x", "y", "z", "rx", "ry", "rz"};
        out.emplace_back(std::string("variance_") + names[i], covariance(i, i));
    }
    out.emplace_back("map_points", static_cast<double>(map_points));
    out.emplace_back("imu_gap_s", imu_gap_s);
    out.emplace_back("lidar_gap_s", lidar_gap_s);
    out.emplace_back("time_preprocess_ms", times.preprocess);
    out.emplace_back("time_deskew_ms", times.deskew);
    out.emplace_back("time_downsample_ms", times.downsample);
    out.emplace_back("time_search_ms", times.search);
    out.emplace_back("time_update_ms", times.update);
    out.emplace_back("time_map_ms", times.map);
    out.emplace_back("time_total_ms", times.total);
    return out;
}

}  // namespace d2lio
