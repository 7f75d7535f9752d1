// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/config.hpp"

namespace d2lio::fastlio {

void HostConfig::bind(ParamTable& t) {
    intake.bind(t);
    t.add("filter_size_surf", filter_size_surf, {0.01, 100.0}, "m", "voxel size of the scan");
    t.add("filter_size_map", filter_size_map, {0.01, 100.0}, "m", "voxel size of the map");
    t.add("max_iteration", max_iteration, {1, 100}, "", "iterations of the filter update");
    t.add("cube_side_length", cube_side_length, {1.0, 1e6}, "m",
          "side of the map's box; up to 3 det_range it would never rest and is made 4 det_range");
    t.add("mapping.det_range", det_range, {1.0, 1e5}, "m",
          "range of the LiDAR; the map's box moves at 1.5 times this from its faces");
    t.add("mapping.acc_cov", noise.accel, {1e-12, 1e6}, "(m/s^2)^2", "accelerometer noise");
    t.add("mapping.gyr_cov", noise.gyro, {1e-12, 1e6}, "(rad/s)^2", "gyroscope noise");
    t.add("mapping.b_acc_cov", noise.accel_bias, {0.0, 1e6}, "(m/s^3)^2",
          "accelerometer bias walk");
    t.add("mapping.b_gyr_cov", noise.gyro_bias, {0.0, 1e6}, "(rad/s^2)^2", "gyroscope bias walk");
    t.add("mapping.extrinsic_est_en", extrinsic_est, "estimate T_imu_lidar online");
    t.add("mapping.exact_jacobians", exact_jacobians,
          "exact rotation blocks where FAST-LIO2's filter uses the identity");
    t.add("map.background_rebuild", background_rebuild,
          "rebalance the map in a second thread (runs no longer repeat bit for bit)");
}

double HostConfig::box_side() const {
    return cube_side_length > 3.0 * det_range ? cube_side_length : 4.0 * det_range;
}

void HostConfig::validate() const {
    intake.validate();
    check_threads(threads);
}

}  // namespace d2lio::fastlio
