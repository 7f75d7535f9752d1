# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Drivers of genz-lio, rko-lio and se3-lio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from driver import NS, Driver, Pose, RefusedError, Scan, Setup


class GenzLio(Driver):
    """genz-lio; its packaged configuration of the sensor's maker, its pose the IMU's at the end."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        import genz_lio

        folder = Path(genz_lio.__file__).parent / "configs" / "default"
        config = genz_lio.load_config(folder / f"{self._maker()}.yaml")
        config.max_threads = setup.threads
        config.preprocess.scan_line = max(1, setup.rings)
        config.preprocess.scan_rate = round(setup.rate_hz)
        config.preprocess.blind_min = setup.min_range_m
        config.preprocess.blind_max = setup.max_range_m
        config.mapping.extrinsic_t = setup.T_imu_lidar[:3, 3]
        config.mapping.extrinsic_r = setup.T_imu_lidar[:3, :3]
        config.mapping.voxel_size = setup.params["voxel_size"]
        config.mapping.down_sample_size = setup.params["down_sample_size"]
        self._odometry = genz_lio.GenZLIO(config)

    def _maker(self) -> str:
        if self.setup.livox:
            return "mid360" if self.setup.model == "mid360" else "avia"
        return "ouster" if self.setup.model.startswith("os") else "velodyne"

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        rows = self.imu.take(scan.end)  # later samples than the last point are refused
        matrix = self.imu_matrix(rows)
        start, end = self.seconds([scan.stamp, scan.end])
        rings = np.zeros(len(scan.xyz), np.int32) if scan.ring is None else scan.ring
        with self.timed():
            found = self._odometry.register_scan(
                scan.xyz,
                float(start),
                float(end),
                matrix,
                timestamps=scan.dt_ns / NS,
                intensities=scan.intensity,
                rings=rings.astype(np.int32),
            )
        if not found.valid:
            raise RefusedError("the estimator has no valid state yet")
        return [(self.stamp(found.timestamp), np.array(found.pose))]


class RkoLio(Driver):
    """rko-lio; the base is the IMU, its pose that at the scan's end."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        from rko_lio.config import LIOConfig
        from rko_lio.lio import LIO

        params = setup.params
        self._odometry = LIO(
            LIOConfig(
                min_range=setup.min_range_m,
                max_range=setup.max_range_m,
                max_num_threads=setup.threads,
                voxel_size=params["voxel_size"],
                initialization_phase=bool(params["initialization_phase"]),
                double_downsample=bool(params["double_downsample"]),
            )
        )

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        rows = self.imu.take(scan.end)
        times = scan.stamp + scan.dt_ns
        still = np.eye(4)
        try:
            with self.timed():
                for stamp, gyro, accel in zip(rows.stamps, rows.gyro, rows.accel, strict=True):
                    self._odometry.add_imu_measurement(accel, gyro, int(stamp), still)
                self._odometry.register_scan(
                    scan.xyz, times, self.setup.T_imu_lidar, int(times.min()), int(times.max())
                )
        except (RuntimeError, ValueError) as err:
            raise RefusedError(str(err)) from None
        return [(int(times.max()), np.array(self._odometry.pose()))]


class Se3Lio(Driver):
    """se3-lio; its pose is the IMU's at the state's own stamp."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        from se3_lio import SE3LIO, SE3LIOConfig

        params = setup.params
        config = SE3LIOConfig(
            downsample_resolution=params["downsample_resolution"],
            lidar_range_noise=params["lidar_range_noise"],
            lidar_angle_noise=params["lidar_angle_noise"],
            voxel_map_resolution=params["voxel_map_resolution"],
        )
        self._odometry = SE3LIO(config, setup.T_imu_lidar)

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        matrix = self.imu_matrix(self.imu.take(scan.end))
        if len(matrix) == 0:
            raise RefusedError("no IMU sample belongs to the scan")
        start = float(self.seconds(scan.stamp))
        with self.timed():
            state, _ = self._odometry.register_frame(scan.xyz, scan.dt_ns / NS, matrix, start)
        return [(self.stamp(state.stamp), np.array(state.pose))]
