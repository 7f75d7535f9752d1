// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/host/configure.hpp"
#include "d2lio/host/intake.hpp"
#include "d2lio/imu/propagation.hpp"
#include "d2lio/map/ikd_tree.hpp"

namespace d2lio::fastlio {

/// FAST_LIO's blind zone and stride.
inline IntakeConfig default_intake() {
    IntakeConfig config;
    config.filter.blind = 0.01;
    config.filter.stride = 2;
    return config;
}

/// FAST-LIO2's constants; the keys bound to them are FAST_LIO's own names.
struct HostConfig {
    IntakeConfig intake = default_intake();
    double filter_size_surf = 0.5;  ///< m, voxel of the scan
    double filter_size_map = 0.5;   ///< m, voxel of the map
    int max_iteration = 3;
    double cube_side_length = 1000.0;  ///< m
    double det_range = 300.0;          ///< m
    ProcessNoise noise;
    bool extrinsic_est = false;
    bool exact_jacobians = false;
    bool background_rebuild = false;
    int threads = 1;

    void bind(ParamTable& table);
    /// Side of the map's box (m): at least what the moving rule needs, else the box never rests.
    double box_side() const;
    /// Checks what no single key can. @throws ConfigError
    void validate() const;
};

}  // namespace d2lio::fastlio
