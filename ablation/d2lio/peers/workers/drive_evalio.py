# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Driver of the pipelines that evalio builds: LIO-SAM, DLIO, LOAM, CT-ICP.

evalio stamps every pose with the start of the scan it was given last; where in time the pose
really lies was measured for each pipeline (`SHIFTS`).
"""

from __future__ import annotations

import os
import threading
import time
from typing import Any

import numpy as np
from driver import Driver, ImuRows, Pose, RefusedError, Scan, Setup
from evalio import pipelines
from evalio.types import SE3, ImuMeasurement, ImuParams, LidarParams
from evalio_cloud import Grid, to_stamp

# In sweeps. Without de-skew a pose is that of the sweep's middle. LIO-SAM holds two clouds back.
SHIFTS = {"loam": 0.5, "ct": 0.0, "dlio": 0.5, "liosam": -1.5}
# DLIO builds its submap in a thread and takes it up when it happens to be done: the result would
# depend on the machine's load. In a scan's time it always is done, so we wait for that.
IN_BACKGROUND = ("dlio",)
SETTLED_S = 1.0  # at most
POLL_S = 0.0002
TASKS = "/proc/self/task"  # Linux; elsewhere there is nothing to see and nothing is waited for
THREADS = ("num_threads", "numberOfCores", "max_num_threads", "ls_num_threads")
OWN_KEYS = ("pipeline",)
NOISE = {"gyro": 1.5e-3, "accel": 4e-3, "gyro_bias": 3.5e-5, "accel_bias": 6.4e-5}


class Evalio(Driver):
    """One of evalio's pipelines; its pose is the IMU's."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._name = str(setup.params["pipeline"])
        self._pipeline = pipelines.get_pipeline(self._name)()
        self._sent: set[int] = set()
        self._grid = Grid(setup.rings, setup.columns, setup.period_ns, setup.livox)
        self._begin()

    def _begin(self) -> None:
        setup, pipe = self.setup, self._pipeline
        if not setup.rings:
            raise ValueError("evalio's clouds need the number of rings (lidar.rings)")
        pipe.set_imu_params(
            ImuParams(**NOISE, gravity=np.array([0.0, 0.0, -9.81]), rate=setup.imu_rate_hz)
        )
        pipe.set_lidar_params(
            LidarParams(
                num_rows=setup.rings,
                num_columns=setup.columns,
                min_range=setup.min_range_m,
                max_range=setup.max_range_m,
                rate=setup.rate_hz,
            )
        )
        pipe.set_imu_T_lidar(SE3.from_mat(setup.T_imu_lidar))
        params = dict(pipe.default_params())
        params.update({key: setup.threads for key in THREADS if key in params})
        params.update({k: v for k, v in setup.params.items() if k not in OWN_KEYS})
        pipe.set_params(params)
        pipe.initialize()

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        cloud = self._cloud(scan)
        samples = _measurements(self.imu.take(scan.end, past=True))
        with self.timed():
            for sample in samples:
                self._pipeline.add_imu(sample)
            self._pipeline.add_lidar(cloud)
            if self._name in IN_BACKGROUND:
                _wait_for_threads()
        return self._poses()

    def _poses(self) -> list[Pose]:
        shift = round(SHIFTS[self._name] * self.setup.period_ns)
        found = {q.to_nsec(): T.to_mat() for q, T in self._pipeline.saved_estimates()}
        self._pipeline.saved_features_matrix()  # or they pile up
        self._pipeline.saved_maps_matrix()
        new = [stamp for stamp in sorted(found) if stamp not in self._sent]
        self._sent.update(new)
        return [(stamp + shift, np.array(found[stamp])) for stamp in new]

    def _cloud(self, scan: Scan) -> Any:
        ring = scan.rings()
        if int(ring.max()) >= self._grid.rows:
            raise RefusedError(f"ring {int(ring.max())} of a LiDAR with {self._grid.rows}")
        return self._grid.cloud(scan.stamp, scan.xyz, scan.dt_ns, scan.intensity, ring)


def _wait_for_threads() -> None:
    """Until no other thread of this process wants to run, seen twice."""
    end = time.perf_counter() + SETTLED_S
    quiet = 0
    while quiet < 2 and time.perf_counter() < end:
        quiet = 0 if _another_runs() else quiet + 1
        time.sleep(POLL_S)


def _another_runs() -> bool:
    own = str(threading.get_native_id())
    for task in os.listdir(TASKS) if os.path.isdir(TASKS) else ():
        if task == own:
            continue
        try:
            with open(f"{TASKS}/{task}/stat", encoding="ascii", errors="replace") as file:
                state = file.read().rpartition(")")[2].split()[0]
        except OSError:
            continue  # it has ended
        if state in "RD":
            return True
    return False


def _measurements(rows: ImuRows) -> list[Any]:
    return [
        ImuMeasurement(to_stamp(t), g.copy(), a.copy())
        for t, g, a in zip(rows.stamps, rows.gyro, rows.accel, strict=True)
    ]
