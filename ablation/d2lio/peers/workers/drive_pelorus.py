# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Driver of pelorus, which estimates in threads of its own and hands poses over when ready."""

from __future__ import annotations

import tempfile
import time

import numpy as np
import pelorus
from driver import NS, Driver, ImuRows, Pose, Scan, Setup, pose

WAIT_S = 2.0  # for the pose of a scan once poses come; a loaded machine may need it
WAIT_START_S = 0.3  # before the first pose, when none may be coming
POLL_S = 0.0005
VARIANCE = [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4]  # not used by the estimator
LEVEL = [1.0, 0.0, 0.0, 0.0]  # no attitude is given


class Pelorus(Driver):
    """Its pose is the LiDAR's; point times are nanoseconds from the scan's stamp."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        with tempfile.NamedTemporaryFile("w", suffix=".rl") as file:
            file.write(self._config())
            file.flush()
            self._handle = pelorus.Handle(file.name)
        self._last = 0  # stamp of the newest pose, ns

    def _config(self) -> str:
        setup = self.setup
        rows = ", ".join(_vector(row) for row in setup.T_imu_lidar[:3, :3])
        millimetres = ", ".join(f"{1e3 * value:.6f}mm" for value in setup.T_imu_lidar[:3, 3])
        return f"""
imu.from_lidar_transform {{
  translation = [{millimetres}]
  rotation = [ {rows} ]
}}
lidar.vendor = {self._vendor()}
preprocessing.filter.distance.range = {setup.min_range_m}m..{setup.max_range_m}m
registration.map.resolution = {round(100 * setup.params["map_resolution"])}cm
parallelism.num_threads = {setup.threads}
output.terminal.ui = false
"""

    def _vendor(self) -> str:
        return "Livox" if self.setup.livox else "Ouster"

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        rows = self.imu.take(scan.end, past=True)
        order = np.argsort(scan.dt_ns, kind="stable")
        offset = int(scan.dt_ns.min())  # unsigned in its clouds
        times = (scan.dt_ns - offset)[order]
        cloud = np.ascontiguousarray(np.c_[scan.xyz[order], scan.intensity[order], times])
        second, nano = divmod(scan.stamp + offset, NS)
        self._handle.add_pointcloud(cloud, timestamp_sec=second, timestamp_nanosec=nano)
        self._add_imu(rows)
        return self._receive(WAIT_S if self._last else WAIT_START_S)

    def finish(self) -> list[Pose]:
        """See `Driver`."""
        return self._receive(WAIT_START_S)

    def _add_imu(self, rows: ImuRows) -> None:
        for stamp, gyro, accel in zip(rows.stamps, rows.gyro, rows.accel, strict=True):
            second, nano = divmod(int(stamp), NS)
            self._handle.add_imu(
                second, nano, LEVEL, VARIANCE, gyro.tolist(), VARIANCE, accel.tolist(), VARIANCE
            )

    def _receive(self, wait_s: float) -> list[Pose]:
        """What is ready, waiting for the first."""
        poses: list[Pose] = []
        end = time.perf_counter() + wait_s
        while True:
            found = self._handle.try_recv()
            if found is None:
                if poses or time.perf_counter() > end:
                    return poses
                time.sleep(POLL_S)
                continue
            w, x, y, z = found["orientation"]
            stamp = int(found["timestamp_sec"]) * NS + int(found["timestamp_nanosec"])
            poses.append((stamp, self.of_lidar(pose(found["position"], (x, y, z, w)))))
            self.busy_s += 1e-9 * (found.get("processing_time_ns") or 0)
            self._last = stamp


def _vector(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.9f}" for value in values) + "]"
