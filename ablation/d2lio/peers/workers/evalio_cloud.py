# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Scans in evalio's layout: a full grid of rings by columns, empty cells zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from evalio._cpp.helpers import (
    DataType,
    Field,
    PointCloudMetadata,
    fill_col_row_major,
    pc2_to_evalio,
)
from evalio.types import Stamp

NS = 1_000_000_000
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


def to_stamp(nanoseconds: int) -> Stamp:
    """evalio's stamp."""
    second, rest = divmod(int(nanoseconds), NS)
    return Stamp(sec=second, nsec=rest)


@dataclass(frozen=True)
class Grid:
    """The cells of a LiDAR.

    Attributes:
        rows: rings; columns: of a sweep; period_ns: of a sweep.
        in_order: columns count the points of a ring (a Livox, whose lines are no circles); else
            they are equal shares of the sweep's time.
    """

    rows: int
    columns: int
    period_ns: int
    in_order: bool = False

    def cloud(
        self,
        stamp: int,
        xyz: np.ndarray,
        dt_ns: np.ndarray,
        intensity: np.ndarray,
        ring: np.ndarray,
    ) -> Any:
        """A LidarMeasurement stamped with the first point's time.

        Args:
            stamp: ns; xyz: [N, 3], m; dt_ns: [N] from the stamp; intensity: [N]; ring: [N], all
                below `rows`. Of two points in a cell the later in the arrays stays.
        """
        ring = ring.astype(np.int64)
        first = int(dt_ns.min())
        times = dt_ns.astype(np.int64) - first
        cells = np.zeros(len(ring), POINT)
        cells["x"], cells["y"], cells["z"] = xyz.T
        cells["intensity"], cells["t"], cells["row"] = intensity, times, ring
        grid = np.zeros((self.rows, self.columns), POINT)
        grid["row"] = np.arange(self.rows)[:, None]
        grid["t"] = (np.arange(self.columns) * self.period_ns // self.columns)[None, :]
        grid[ring, self._columns(ring, times)] = cells
        meta = PointCloudMetadata(
            stamp=to_stamp(stamp + first),
            width=self.columns,
            height=self.rows,
            point_step=POINT.itemsize,
            row_step=POINT.itemsize * self.columns,
            is_bigendian=0,
            is_dense=1,
        )
        measurement = pc2_to_evalio(meta, FIELDS, grid.tobytes())
        fill_col_row_major(measurement)
        return measurement

    def _columns(self, ring: np.ndarray, times: np.ndarray) -> np.ndarray:
        if not self.in_order:
            column = (times + COLUMN_SLACK_NS) * self.columns // self.period_ns
            return np.minimum(column, self.columns - 1)
        order = np.lexsort((times, ring))
        first = np.searchsorted(ring[order], np.arange(self.rows))
        column = np.empty(len(ring), np.int64)
        column[order] = np.arange(len(ring)) - first[ring[order]]
        return np.minimum(column, self.columns - 1)
