// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "d2lio/host/configure.hpp"
#include "d2lio/host/intake.hpp"
#include "d2lio/host/result.hpp"
#include "d2lio/types.hpp"

namespace d2lio::liosam {

/// Defaults to start from; every key can be set in either.
enum class Preset {
    kLioSam,  ///< LIO-SAM: features, its own gates, 5 Hz
    /// The paper's modified LIO-SAM, Algorithm 1: every scan, voxel points, point-to-plane,
    /// point-adaptive rejection, directional prior.
    kD2Lio,
};

/// LiDAR-inertial odometry on a sliding keyframe submap with a GTSAM graph of inertial factors
/// beside it. Feed samples and scans in any interleaving, call step() until it has nothing more.
/// Deterministic whatever the thread count. Not thread-safe.
class Host {
  public:
    /// @throws ConfigError naming key, value and allowed range, for unknown keys too.
    explicit Host(Preset preset, const ParamMap& params, int threads = 1);
    ~Host();
    Host(Host&&) noexcept;
    Host& operator=(Host&&) noexcept;

    /// Every parameter with the preset's default, range, unit and meaning.
    static std::vector<ParamInfo> describe(Preset preset);

    PushStatus add_imu(const ImuSample& sample);
    /// @param scan points in the LiDAR frame, offsets relative to its stamp.
    PushStatus add_scan(Scan scan);
    /// No more data will come: what is still complete becomes available to step().
    void finish();
    /// Processes the next scan whose inertial data is complete; nothing if there is none.
    std::optional<ScanResult> step();

    /// Changes parameters of rejection and degeneracy between two scans; the estimate goes on.
    /// @throws ConfigError for any other key or a refused value; nothing has changed then.
    void reconfigure(const ParamMap& changes);

    /// The points that the last scan was matched with, map frame, m; none if it was not.
    std::vector<Eigen::Vector3f> scan_points() const;
    std::vector<Verdict> verdicts() const;            ///< what became of each of them
    std::vector<Eigen::Vector3f> map_points() const;  ///< current submap, map frame, m
    HostCounts counts() const;
    SyncReport sync_report() const;  ///< whether data flow, and if not, why
    std::size_t map_bytes() const;   ///< keyframe clouds and submap

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace d2lio::liosam
