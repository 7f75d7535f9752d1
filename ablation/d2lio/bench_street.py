# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""An endless street cast without a mesh: light enough for half an hour of driving.

World: x along the street, z up, the ground at z = 0. On either side stands a row of houses of
random width and setback; their side walls and the lamp posts show the motion along the street.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from d2lio.simulator import imu as imu_model
from d2lio.simulator.trajectory import Trajectory, drive

RINGS = 16
COLUMNS = 160  # a tenth of a VLP-16's: 2560 rays a scan
ELEVATION_RAD = np.deg2rad(np.linspace(-15.0, 15.0, RINGS))
SCAN_NS = 100_000_000
IMU_STEP = 2  # of the simulator's samples: 100 Hz
SENSOR_HEIGHT_M = 1.8
MAX_RANGE_M = 70.0
RANGE_NOISE_M = 0.02
HOUSE_HEIGHT_M = 9.0
HOUSE_WIDTHS_M = (7.0, 16.0)
SETBACK_M = (7.0, 11.0)  # of the fronts from the middle of the street
POST_SPACING_M = 25.0
POST_DISTANCE_M = 5.0  # from the middle of the street
POST_RADIUS_M = 0.12
POST_HEIGHT_M = 6.0


@dataclass(frozen=True)
class Side:
    """Houses of one side: walls at x (n+1,), fronts at |y| (n,) m."""

    sign: float
    walls: np.ndarray
    fronts: np.ndarray


def build_side(sign: float, length: float, rng: np.random.Generator) -> Side:
    """Houses from MAX_RANGE_M before the start to MAX_RANGE_M beyond `length` m."""
    count = int((length + 2.0 * MAX_RANGE_M) / HOUSE_WIDTHS_M[0]) + 2
    walls = -MAX_RANGE_M + np.concatenate([[0.0], np.cumsum(rng.uniform(*HOUSE_WIDTHS_M, count))])
    return Side(sign, walls, rng.uniform(*SETBACK_M, count))


class Street:
    """Street, drive and sensors.

    Args:
        duration: s of driving.
        speed: mean, m/s.
        seed: of everything.
    """

    def __init__(self, duration: float, speed: float = 9.0, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        length = 1.3 * speed * duration
        self._sides = [build_side(sign, length, self._rng) for sign in (1.0, -1.0)]
        self._posts = self._place_posts(length)
        self.trajectory: Trajectory = drive(_lane, speed, duration, self._rng)
        stamps = imu_model.sample_times(duration)
        gyro, accel = imu_model.measure(
            self.trajectory, stamps, imu_model.IMU_GRADES["industrial"], self._rng
        )
        self.imu_stamps = stamps[::IMU_STEP]
        self.gyro, self.accel = gyro[::IMU_STEP].copy(), accel[::IMU_STEP].copy()
        self.scans = int(duration * 1e9) // SCAN_NS - 1

    def _place_posts(self, length: float) -> np.ndarray:
        x = np.arange(-MAX_RANGE_M, length + MAX_RANGE_M, POST_SPACING_M)
        x = x + self._rng.uniform(-5.0, 5.0, len(x))
        y = POST_DISTANCE_M * np.where(np.arange(len(x)) % 2, 1.0, -1.0)
        return np.stack([x, y], axis=1)

    def scan(self, index: int) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        """Stamp ns, points float32 [N, 3] m (LiDAR is IMU), offsets int32 [N] ns, ring uint16 [N].

        Every column of rays is cast from the pose at its own time.
        """
        start = index * SCAN_NS
        offsets = np.arange(COLUMNS, dtype=np.int64) * (SCAN_NS // COLUMNS)
        position, rotation = self.trajectory.pose((start + offsets) * 1e-9)
        turn = np.pi - 2.0 * np.pi * np.arange(COLUMNS) / COLUMNS
        flat = np.cos(ELEVATION_RAD)
        beams = np.empty((COLUMNS, RINGS, 3))
        beams[..., 0] = np.cos(turn)[:, None] * flat
        beams[..., 1] = np.sin(turn)[:, None] * flat
        beams[..., 2] = np.sin(ELEVATION_RAD)
        directions = np.einsum("cij,crj->cri", rotation, beams).reshape(-1, 3)
        origins = np.repeat(position, RINGS, axis=0)
        distance = self._cast(origins, directions)
        hit = distance < MAX_RANGE_M
        distance = distance[hit] + RANGE_NOISE_M * self._rng.standard_normal(int(hit.sum()))
        points = beams.reshape(-1, 3)[hit] * distance[:, None]
        ring = np.tile(np.arange(RINGS, dtype=np.uint16), COLUMNS)[hit]
        return (
            start,
            points.astype(np.float32),
            np.repeat(offsets, RINGS)[hit].astype(np.int32),
            ring,
        )

    def _cast(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            ground = -origin[:, 2] / direction[:, 2]
        distance = np.where(ground > 0.0, ground, np.inf)
        x = float(origin[:, 0].mean())
        for side in self._sides:
            near = direction[:, 1] * side.sign > 1e-9
            distance[near] = np.minimum(
                distance[near], _cast_houses(side, origin[near], direction[near], x)
            )
        ahead = np.abs(self._posts[:, 0] - x) < MAX_RANGE_M
        for post in self._posts[ahead]:
            _cast_post(post, origin, direction, distance)
        return distance


def _lane(s: np.ndarray) -> np.ndarray:
    """Positions (n, 3) m after s (n,) m: a car that weaves a little within its lane."""
    return np.stack([s, 0.8 * np.sin(s / 45.0), np.full_like(s, SENSOR_HEIGHT_M)], axis=1)


def _cast_houses(side: Side, origin: np.ndarray, direction: np.ndarray, x: float) -> np.ndarray:
    """Distances (n,) m to fronts and side walls; the rays go towards this side."""
    first, last = np.searchsorted(side.walls, [x - MAX_RANGE_M, x + MAX_RANGE_M])
    first = max(first - 1, 0)
    distance = np.full(len(origin), np.inf)

    def keep(along: np.ndarray, good: np.ndarray) -> None:
        height = origin[:, 2] + along * direction[:, 2]
        good &= (along > 0.0) & (height < HOUSE_HEIGHT_M) & (along < distance)
        distance[good] = along[good]

    for k in range(first, min(last, len(side.fronts))):
        along = (side.sign * side.fronts[k] - origin[:, 1]) / direction[:, 1]
        at = origin[:, 0] + along * direction[:, 0]
        keep(along, (at >= side.walls[k]) & (at < side.walls[k + 1]))
        if k == first:
            continue
        low, high = sorted((side.fronts[k - 1], side.fronts[k]))
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (side.walls[k] - origin[:, 0]) / direction[:, 0]
            out = side.sign * (origin[:, 1] + along * direction[:, 1])
            keep(along, (out >= low) & (out <= high))
    return distance


def _cast_post(
    post: np.ndarray, origin: np.ndarray, direction: np.ndarray, distance: np.ndarray
) -> None:
    """Shortens `distance` of the rays that hit an upright cylinder at `post` (2,) m."""
    to_post = post - origin[:, :2]
    flat = np.hypot(direction[:, 0], direction[:, 1])
    heading = direction[:, :2] / flat[:, None]
    along = np.einsum("ni,ni->n", to_post, heading)
    across = to_post[:, 0] * heading[:, 1] - to_post[:, 1] * heading[:, 0]
    index = np.flatnonzero((np.abs(across) < POST_RADIUS_M) & (along > 0.0))
    depth = along[index] - np.sqrt(POST_RADIUS_M**2 - across[index] ** 2)
    reach = depth / flat[index]
    low = origin[index, 2] + reach * direction[index, 2] < POST_HEIGHT_M
    index, reach = index[low], reach[low]
    distance[index] = np.minimum(distance[index], reach)
