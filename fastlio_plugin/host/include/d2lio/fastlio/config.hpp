// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "d2lio/config/params.hpp"
#include "d2lio/imu/propagation.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "d2lio/preprocess/point_filter.hpp"
#include "d2lio/preprocess/synchronizer.hpp"

namespace d2lio::fastlio {

/// FAST-LIO2's constants; the keys bound to them are FAST_LIO's own names.
struct HostConfig {
    PointFilterOptions filter{0.01, kInf, 2};
    double filter_size_surf = 0.5;  ///< m, voxel of the scan
    double filter_size_map = 0.5;   ///< m, voxel of the map
    int max_iteration = 3;
    double cube_side_length = 1000.0;  ///< m
    double det_range = 300.0;          ///< m
    ProcessNoise noise;
    bool extrinsic_est = false;
    double extrinsic_T[3] = {0, 0, 0};                    ///< t_imu_lidar, m
    double extrinsic_R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< R_imu_lidar, by rows
    bool exact_jacobians = false;
    int init_samples = 10;          ///< inertial samples averaged at the start
    double imu_gap_reset = 1.0;     ///< s, a longer gap starts a new epoch
    double lidar_gap_reset = 10.0;  ///< s, likewise
    SynchronizerOptions sync;
    bool live = false;  ///< bounded queues
    bool background_rebuild = false;
    int threads = 1;

    void bind(ParamTable& table);
    /// T_imu_lidar. @throws ConfigError if the rotation is none, with its determinant.
    Pose extrinsic() const;
    /// Side of the map's box (m): at least what the moving rule needs, else the box never rests.
    double box_side() const;
    /// Checks what no single key can. @throws ConfigError
    void validate() const;
};

using ParamMap = std::map<std::string, std::string>;

}  // namespace d2lio::fastlio
