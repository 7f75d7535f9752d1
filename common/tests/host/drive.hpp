// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "d2lio/host/configure.hpp"
#include "d2lio/host/result.hpp"
#include "synthetic_room.hpp"

namespace d2lio::test {

/// Parameters that fit SyntheticRoom.
inline ParamMap room_params(ParamMap extra = {}) {
    const Pose T = SyntheticRoom::T_imu_lidar();
    std::string R, t;
    for (int r = 0; r < 3; ++r) {
        t += std::to_string(T.t[r]) + " ";
        for (int c = 0; c < 3; ++c) R += std::to_string(T.R(r, c)) + " ";
    }
    ParamMap params{{"mapping.extrinsic_R", R},
                    {"mapping.extrinsic_T", t},
                    {"point_filter_num", "1"},
                    {"preprocess.blind", "0.3"}};
    for (auto& [key, value] : extra) params[key] = value;
    return params;
}

template <typename Host>
void step_all(Host& host, std::vector<ScanResult>& out) {
    while (auto r = host.step()) out.push_back(std::move(*r));
}

/// Feeds samples and scans in order of arrival. `keep_imu` and `edit` may damage the data.
struct Drive {
    int scans = 40;
    Stamp start = SyntheticRoom::kStart;
    std::function<bool(ImuSample&)> keep_imu = [](ImuSample&) { return true; };
    std::function<bool(int, Scan&)> edit = [](int, Scan&) { return true; };

    template <typename Host>
    void feed(Host& host, SyntheticRoom& room, std::vector<ScanResult>& out) const {
        Stamp imu = start;
        for (int i = 0; i < scans; ++i) {
            const Stamp begin = start + i * SyntheticRoom::kScanPeriod;
            Scan scan = room.scan(begin);
            if (edit(i, scan)) host.add_scan(std::move(scan));
            for (; imu <= begin + SyntheticRoom::kScanPeriod; imu += SyntheticRoom::kImuPeriod) {
                ImuSample s = room.imu(imu);
                if (keep_imu(s)) host.add_imu(s);
            }
            step_all(host, out);
        }
    }
};

/// Everything a fresh host makes of the drive.
template <typename Host>
std::vector<ScanResult> run_host(Host host, const Drive& drive) {
    SyntheticRoom room;
    std::vector<ScanResult> out;
    drive.feed(host, room, out);
    host.finish();
    step_all(host, out);
    return out;
}

/// Largest distance (m) between estimate and truth, both relative to the first pose; infinity when
/// fewer than `missing` short of all scans have a pose.
inline double largest_error(const std::vector<ScanResult>& results, std::size_t missing = 3) {
    const ScanResult* first = nullptr;
    double worst = 0.0;
    std::size_t poses = 0;
    for (const auto& r : results) {
        if (!r.has_pose) continue;
        if (first == nullptr) first = &r;
        ++poses;
        const auto truth = [](const ScanResult& x) {
            return SyntheticRoom::pose(seconds_between(x.stamp, SyntheticRoom::kStart));
        };
        const Pose estimated = first->state.T_map_imu().inverse() * r.state.T_map_imu();
        const Pose expected = truth(*first).inverse() * truth(r);
        worst = std::max(worst, (estimated.t - expected.t).norm());
    }
    return poses > 0 && poses + missing >= results.size() ? worst : kInf;
}

}  // namespace d2lio::test
