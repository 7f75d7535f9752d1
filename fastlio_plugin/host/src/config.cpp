// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/config.hpp"

#include "d2lio/preprocess/extrinsic.hpp"

namespace d2lio::fastlio {

void HostConfig::bind(ParamTable& t) {
    t.add("preprocess.blind", filter.blind, {0.0, kInf}, "m", "nearer returns are dropped");
    t.add("preprocess.max_range", filter.max_range, {0.0, kInf}, "m",
          "farther returns are dropped");
    t.add("point_filter_num", filter.stride, {1, 1000}, "", "every n-th point of a scan is used");
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
    t.add("mapping.extrinsic_T", extrinsic_T, 3, {-1e3, 1e3}, "m", "translation of T_imu_lidar");
    t.add("mapping.extrinsic_R", extrinsic_R, 9, {-2.0, 2.0}, "", "rotation of T_imu_lidar, rows");
    t.add("mapping.exact_jacobians", exact_jacobians,
          "exact rotation blocks where FAST-LIO2's filter uses the identity");
    t.add("imu.init_samples", init_samples, {2, 10000}, "", "samples averaged at the start");
    t.add("imu.gap_warn", sync.imu_gap_warn_s, {0.001, kInf}, "s",
          "a longer gap in the IMU data (and 3 periods) is told and makes the prediction looser");
    t.add("imu.gap_reset", imu_gap_reset, {0.05, kInf}, "s",
          "a longer gap in the IMU data starts a new epoch");
    t.add("lidar.gap_warn", sync.lidar_gap_warn_s, {0.001, kInf}, "s",
          "a longer gap in the LiDAR data is told");
    t.add("lidar.gap_reset", lidar_gap_reset, {0.5, kInf}, "s",
          "a longer gap in the LiDAR data starts a new epoch");
    t.add("live", live, "bounded queues: drop the oldest scan rather than fall behind");
    t.add("map.background_rebuild", background_rebuild,
          "rebalance the map in a second thread (runs no longer repeat bit for bit)");
}

Pose HostConfig::extrinsic() const {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    return checked_extrinsic(Eigen::Map<const RowMajor>(extrinsic_R),
                             Eigen::Map<const Vec3>(extrinsic_T), "mapping.extrinsic_R");
}

double HostConfig::box_side() const {
    return cube_side_length > 3.0 * det_range ? cube_side_length : 4.0 * det_range;
}

void HostConfig::validate() const {
    extrinsic();
    if (!(filter.max_range > filter.blind)) {
        throw ConfigError("preprocess.max_range", std::to_string(filter.max_range),
                          "more than preprocess.blind = " + std::to_string(filter.blind));
    }
    if (threads < 1 || threads > 256) {
        throw ConfigError("threads", std::to_string(threads), "[1, 256]");
    }
}

}  // namespace d2lio::fastlio
