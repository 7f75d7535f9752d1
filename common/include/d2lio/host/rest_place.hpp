// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/types.hpp"

/// What a host does at the place where a run begins at rest (method noise_aware).
namespace d2lio {

/// Where the body began.
struct RestPlace {
    Pose pose;  ///< T_map_imu

    /// Whether an estimate left the place in a direction that its scan can see: by 5 cm or 10 mrad.
    bool left(const Pose& estimate, const ScanDiagnostics& scan) const;
};

/// Mean of the scans at rest, voxel by voxel. All later poses rest on the map of that place, and
/// the noise of a single scan tilts it by a milliradian.
class RestCloud {
  public:
    void start(const std::vector<Eigen::Vector3f>& points);
    /// @returns false, and nothing happens, once 50 scans are in.
    bool add(const std::vector<Eigen::Vector3f>& points);
    std::vector<Eigen::Vector3f> mean(double leaf) const;  ///< @param leaf voxel, m
    /// Frees the points.
    void finish();

  private:
    std::vector<Eigen::Vector3f> points_;
    int scans_ = 0;
};

}  // namespace d2lio
