# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Driver of the pipelines that evalio builds: LIO-SAM, DLIO, LOAM, CT-ICP.

evalio stamps every pose with the start of the scan it was given last; where in time the pose
really lies was measured for each pipeline (`SHIFTS`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from driver import NS, Driver, ImuRows, Pose, RefusedError, Scan, Setup
from evalio import pipelines
from evalio._cpp.helpers import (
    DataType,
    Field,
    PointCloudMetadata,
    fill_col_row_major,
    pc2_to_evalio,
)
from evalio.types import SE3, ImuMeasurement, ImuParams, LidarParams, Stamp

# In sweeps. Without de-skew a pose is that of the sweep's middle. LIO-SAM holds two clouds back.
SHIFTS = {"loam": 0.5, "ct": 0.0, "dlio": 0.5, "liosam": -1.5}
THREADS = ("num_threads", "numberOfCores", "max_num_threads", "ls_num_threads")
OWN_KEYS = ("pipeline",)
NOISE = {"gyro": 1.5e-3, "accel": 4e-3, "gyro_bias": 3.5e-5, "accel_bias": 6.4e-5}
COLUMN_SLACK_NS = 100  # times are rounded; a point at a column's edge stays in it
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "row"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2"],
        "offsets": [0, 4, 8, 12, 16, 20],
        "itemsize": 24,
    }
)
FIELD_TYPES = {"<f4": DataType.FLOAT32, "<u4": DataType.UINT32, "<u2": DataType.UINT16}
FIELDS = [
    Field(name=name, datatype=FIELD_TYPES[dtype.str], offset=offset)
    for name, (dtype, offset) in ((n, POINT.fields[n][:2]) for n in POINT.names)
]


class Evalio(Driver):
    """One of evalio's pipelines; its pose is the IMU's."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._name = str(setup.params["pipeline"])
        self._pipeline = pipelines.get_pipeline(self._name)()
        self._sent: set[int] = set()
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
        """The scan as evalio's full grid of rings by columns, empty cells zero."""
        rows, columns, period = self.setup.rings, self.setup.columns, self.setup.period_ns
        ring = scan.rings().astype(np.int64)
        if int(ring.max()) >= rows:
            raise RefusedError(f"ring {int(ring.max())} of a LiDAR with {rows}")
        grid = np.zeros((rows, columns), POINT)
        grid["row"] = np.arange(rows)[:, None]
        grid["t"] = (np.arange(columns) * period // columns)[None, :]
        times = scan.dt_ns - int(scan.dt_ns.min())
        column = self._columns(ring, times)
        cells = np.zeros(len(ring), POINT)
        cells["x"], cells["y"], cells["z"] = scan.xyz.T
        cells["intensity"], cells["t"], cells["row"] = scan.intensity, times, ring
        grid[ring, column] = cells
        second, nano = divmod(scan.stamp + int(scan.dt_ns.min()), NS)
        meta = PointCloudMetadata(
            stamp=Stamp(sec=second, nsec=nano),
            width=columns,
            height=rows,
            point_step=POINT.itemsize,
            row_step=POINT.itemsize * columns,
            is_bigendian=0,
            is_dense=1,
        )
        cloud = pc2_to_evalio(meta, FIELDS, grid.tobytes())
        fill_col_row_major(cloud)
        return cloud

    def _columns(self, ring: np.ndarray, times: np.ndarray) -> np.ndarray:
        """By time; of a Livox, whose lines are no circles, the points of a line in order."""
        columns = self.setup.columns
        if not self.setup.livox:
            column = (times + COLUMN_SLACK_NS) * columns // self.setup.period_ns
            return np.minimum(column, columns - 1)
        order = np.lexsort((times, ring))
        first = np.searchsorted(ring[order], np.arange(self.setup.rings))
        column = np.empty(len(ring), np.int64)
        column[order] = np.arange(len(ring)) - first[ring[order]]
        return np.minimum(column, columns - 1)


def _measurements(rows: ImuRows) -> list[Any]:
    return [
        ImuMeasurement(Stamp(sec=int(t) // NS, nsec=int(t) % NS), g.copy(), a.copy())
        for t, g, a in zip(rows.stamps, rows.gyro, rows.accel, strict=True)
    ]
