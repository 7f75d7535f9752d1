// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/config/params.hpp"
#include "d2lio/ros1/estimator.hpp"

namespace d2lio::ros1 {

/// A host with the hosts' intake and a pose that moves 0.1 m a scan; knows a few of their keys.
class FakeHost {
  public:
    explicit FakeHost(const ParamMap& params) : intake_(load(params)) {}

    static void bind(ParamTable& table, IntakeConfig& config, int& mode, double& range) {
        config.bind(table);
        table.add("rejection.mode", mode_of(mode), {"off", "none", "kiss"}, "strategy");
        table.add("mapping.det_range", range, {1.0, 1e5}, "m", "range of the LiDAR");
    }
    static std::vector<ParamInfo> describe() {
        IntakeConfig config;
        int mode = 0;
        double range = 1.0;
        ParamTable table;
        bind(table, config, mode, range);
        return table.describe();
    }

    PushStatus add_imu(const ImuSample& sample) { return intake_.add_imu(sample); }
    PushStatus add_scan(Scan scan) { return intake_.add_scan(std::move(scan)); }
    void finish() { intake_.finish(); }
    std::optional<ScanResult> step() {
        ScanResult r;
        const auto group = intake_.next(r);
        if (!group) return std::nullopt;
        r.new_epoch = group->new_epoch;
        r.has_pose = true;
        r.status = ScanStatus::kOk;
        r.health = Health::kOk;
        r.state.pos.x() = 0.1 * static_cast<double>(steps_++);
        return r;
    }
    std::vector<Eigen::Vector3f> map_points() const { return {{1, 2, 3}}; }
    HostCounts counts() const { return {intake_.sync_counts(), intake_.filter_counts(), 0, {}}; }
    SyncReport sync_report() const { return intake_.report(); }

  private:
    enum class Mode { kOff, kNone, kKiss };
    static Mode& mode_of(int& mode) { return reinterpret_cast<Mode&>(mode); }
    static IntakeConfig load(const ParamMap& params) {
        IntakeConfig config;
        int mode = 0;
        double range = 1.0;
        ParamTable table;
        bind(table, config, mode, range);
        for (const auto& [key, value] : params) table.set(key, value);
        config.validate();
        return config;
    }

    Intake intake_;
    int steps_ = 0;
};

inline std::vector<EstimatorKind> fake_kinds() {
    const auto make = [](const ParamMap& params, int) -> std::unique_ptr<Estimator> {
        return std::make_unique<HostEstimator<FakeHost>>(FakeHost(params));
    };
    return {{"fastlio", FakeHost::describe(), make}, {"d2lio", FakeHost::describe(), make}};
}

}  // namespace d2lio::ros1
