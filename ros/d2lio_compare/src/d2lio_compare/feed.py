# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What one variant said so far."""

from __future__ import annotations

import csv
import os
import time
from typing import Any

import numpy as np

from d2lio_compare.poses import Truth, matrix, quaternion_of, tum_line
from d2lio_compare.shared.board import Counts, Line
from d2lio_compare.shared.names import Variant
from d2lio_compare.shared.running import RunningApe

TRAJECTORY_FILE, DIAGNOSTICS_FILE = "trajectory.tum", "diagnostics.csv"  # as `d2lio run` has them
ONE_STATUS_KEY = "lambda_t_1"  # the status of a scan has it, other ones of a node do not
HEALTH = {0: "OK", 1: "DEGENERATE", 2: "LOST"}
DEAD = "DEAD"


class Feed:
    """Odometry and diagnostics of a variant; the caller keeps threads apart.

    Args:
        folder: for trajectory and diagnostics where nobody else saves them; empty for none.
        T_imu_lidar: [4, 4] of a node whose odometry is that of the LiDAR, else None.
    """

    def __init__(
        self, variant: Variant, truth: Truth, folder: str = "", T_imu_lidar: Any = None
    ) -> None:
        self.variant = variant
        self.ape = RunningApe(truth.stamps, truth.positions)
        self.pose: tuple[int, np.ndarray, np.ndarray] | None = None
        self.first_pose: tuple[int, np.ndarray, np.ndarray] | None = None
        self.dead = False
        self.epochs = 1
        self.heard = time.monotonic()
        self._counts = Counts()
        self._queue = 0.0
        self._T_lidar_imu = None if T_imu_lidar is None else np.linalg.inv(T_imu_lidar)
        self._tum: Any = None
        self._csv: Any = None
        self._writer: Any = None
        if folder:
            os.makedirs(folder, exist_ok=True)
            self._tum = _created(folder, TRAJECTORY_FILE)
            self._csv = _created(folder, DIAGNOSTICS_FILE)

    def add_pose(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """T_map_imu at `stamp`, ns. A stamp that jumps back begins a new trajectory."""
        if self._T_lidar_imu is not None:
            rotation = matrix(quaternion)
            position = position + rotation @ self._T_lidar_imu[:3, 3]
            quaternion = quaternion_of(rotation @ self._T_lidar_imu[:3, :3])
        self.heard = time.monotonic()
        if self.pose is not None and stamp < self.pose[0]:
            self.ape.clear()
            self.epochs += 1
            self.first_pose = None
        if not self.ape.add(stamp, position):
            return
        self.pose = (stamp, position, quaternion)
        self.first_pose = self.first_pose or self.pose
        if self._tum is not None:
            self._tum.write(tum_line(stamp, position, quaternion))
            self._tum.flush()

    def add_status(self, stamp: int, level: int, row: dict[str, str]) -> None:
        """The status of one scan: its key-value pairs are columns of diagnostics.csv."""
        if ONE_STATUS_KEY not in row:
            return
        self.heard = time.monotonic()
        row.setdefault("stamp_ns", str(stamp))
        row.setdefault("status", "ok")
        row.setdefault("health", HEALTH.get(level, ""))
        self._counts.add(row)
        self._queue = float(row.get("queue") or 0.0)
        if self._csv is None:
            return
        if self._writer is None:
            self._writer = csv.DictWriter(
                self._csv, list(row), extrasaction="ignore", restval="", lineterminator="\n"
            )
            self._writer.writeheader()
        self._writer.writerow(row)
        self._csv.flush()

    def quiet(self, seconds: float) -> bool:
        """Whether it has nothing left to do: nothing waits, and nothing came for a while."""
        idle = time.monotonic() - self.heard >= seconds
        return self.dead or (idle and self._queue == 0.0)

    def line(self) -> Line:
        """Its line of the scoreboard."""
        ape = self.ape.rmse() if self.pose else None
        return self._counts.line(self.variant.title, DEAD if self.dead else "", ape, len(self.ape))

    def close(self) -> None:
        """Closes its files."""
        for file in (self._tum, self._csv):
            if file is not None:
                file.close()


def _created(folder: str, name: str) -> Any:
    """A text file that stays open as long as the node runs."""
    return open(os.path.join(folder, name), "w", encoding="utf-8", newline="")
