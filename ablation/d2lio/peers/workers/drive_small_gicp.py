# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""An odometry loop around small_gicp: VGICP of each scan against a voxel map of the way so far."""

from __future__ import annotations

import numpy as np
import small_gicp
from driver import Driver, Pose, Scan, Setup

LRU_CLEAR_CYCLE = 10  # scans


class SmallGicp(Driver):
    """Constant velocity is both the guess and the de-skew."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        params = setup.params
        self._map = small_gicp.GaussianVoxelMap(params["voxel_size"])
        self._map.set_lru(horizon=int(params["map_scans"]), clear_cycle=LRU_CLEAR_CYCLE)
        self._T = np.eye(4)  # T_map_lidar at the end of the last scan
        self._step = np.eye(4)  # motion over one scan
        self._started = False

    def scan(self, scan: Scan) -> list[Pose]:
        """See `Driver`."""
        deskew = bool(self.setup.params["deskew"])
        with self.timed():
            share = (scan.dt_ns - scan.dt_ns.max()) / self.setup.period_ns
            points = moved(scan.xyz, share, self._step) if deskew else scan.xyz
            self._register(points)
        return [(scan.end if deskew else scan.middle, self.of_lidar(self._T))]

    def _register(self, points: np.ndarray) -> None:
        params, threads = self.setup.params, self.setup.threads
        cloud, _ = small_gicp.preprocess_points(
            points, params["downsampling_resolution"], num_threads=threads
        )
        if self._started:
            found = small_gicp.align(
                self._map,
                cloud,
                self._T @ self._step,
                max_correspondence_distance=params["max_correspondence_distance"],
                num_threads=threads,
                max_iterations=int(params["max_iterations"]),
            )
            T = np.asarray(found.T_target_source)
            self._step = np.linalg.inv(self._T) @ T
            self._T = T
        self._started = True
        self._map.insert(cloud, self._T)


def moved(xyz: np.ndarray, share: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Points carried along shares of a motion: rotation by its axis, translation linear.

    Args:
        xyz: [N, 3], m; share: [N] of the motion, 0 leaves a point; step: T [4, 4].
    """
    R = step[:3, :3]
    vector = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
    sine = float(np.linalg.norm(vector))
    angle = share * np.arctan2(sine, (np.trace(R) - 1.0) / 2.0)
    axis = vector / sine if sine > 0.0 else np.zeros(3)
    # Rodrigues: v cos + (k x v) sin + k (k . v)(1 - cos)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned = xyz * cos + np.cross(axis, xyz) * sin + np.outer(xyz @ axis, axis) * (1.0 - cos)
    return turned + share[:, None] * step[:3, 3]
