# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Drivers of kiss-icp, genz-icp and mad-icp, which use no IMU."""

from __future__ import annotations

from typing import Any

import numpy as np
from driver import NS, Driver, Pose, Scan, Setup


class _Icp(Driver):
    """KISS-ICP's interface, which GenZ-ICP shares: de-skewed poses belong to the scan's end."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.deskew = bool(setup.params["deskew"])
        self.odometry: Any = None

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        times = scan.dt_ns / NS
        with self.timed():
            self.odometry.register_frame(scan.xyz, times)
        moment = scan.end if self.deskew else scan.middle
        return [(moment, self.of_lidar(self.odometry.last_pose))]

    def _data(self, config: Any) -> None:
        config.data.max_range = self.setup.max_range_m
        config.data.min_range = self.setup.min_range_m
        config.data.deskew = self.deskew


class KissIcp(_Icp):
    """kiss-icp."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        from kiss_icp.config import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        config = KISSConfig()
        self._data(config)
        config.mapping.voxel_size = setup.params["voxel_size"] or setup.max_range_m / 100.0
        config.registration.max_num_threads = setup.threads
        self.odometry = KissICP(config)


class GenzIcp(_Icp):
    """genz-icp. Its threads cannot be set, and with several it gives another result every time."""

    SCANS_TO_WARM_UP = 3  # the first have no map to register to

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        from genz_icp.config import GenZConfig
        from genz_icp.genz_icp import GenZICP

        config = GenZConfig()
        self._data(config)
        config.mapping.voxel_size = setup.params["voxel_size"]
        self.odometry = GenZICP(config)
        self._scans = 0

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        self._scans += 1
        if self._scans > self.SCANS_TO_WARM_UP:
            return super().scan(scan)
        with self.few_cpus():
            return super().scan(scan)


class MadIcp(Driver):
    """mad-icp, with the parameters of its default.cfg."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        from mad_icp.src.pybind.pypeline import Pipeline, VectorEigen3d

        self._vector = VectorEigen3d
        params = setup.params
        self._deskew = bool(params["deskew"])
        self._pipeline = Pipeline(
            setup.rate_hz,
            self._deskew,
            params["b_max"],
            params["rho_ker"],
            params["p_th"],
            params["b_min"],
            params["b_ratio"],
            int(params["keyframes"]),
            setup.threads,
            False,
        )

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        points = self._vector(np.ascontiguousarray(scan.xyz))
        start = float(self.seconds(scan.stamp))
        with self.timed():
            self._pipeline.compute(start, points)
        moment = scan.end if self._deskew else scan.middle
        return [(moment, self.of_lidar(self._pipeline.currentPose()))]
