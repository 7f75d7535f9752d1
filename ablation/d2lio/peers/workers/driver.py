# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the drivers of the peers share: data as it comes, time, frames, the stop watch."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

NS = 1_000_000_000
EPOCH_S = 1000  # the data begin here in the peers' clock; seconds as floats stay exact to 1 ns
LIVOX = ("avia", "horizon", "mid360", "livox")

Pose = tuple[int, np.ndarray]  # stamp in ns, T_map_imu [4, 4]


class RefusedError(RuntimeError):
    """The peer took nothing from this scan; the run goes on."""


@dataclass(frozen=True)
class Setup:
    """What a driver is made from.

    Attributes:
        T_imu_lidar: float64 [4, 4], m.
        model: of the LiDAR, in lower case; rings, columns, rate_hz, min_range_m, max_range_m: its.
        imu_rate_hz: of the IMU.
        params: the peer's own settings.
        threads: how many the peer may use.
    """

    T_imu_lidar: np.ndarray
    model: str
    rings: int
    columns: int
    rate_hz: float
    min_range_m: float
    max_range_m: float
    imu_rate_hz: float
    params: dict[str, Any]
    threads: int

    @property
    def period_ns(self) -> int:
        """Nominal time of a sweep."""
        return round(NS / self.rate_hz)

    @property
    def livox(self) -> bool:
        """Whether the points of a scan lie in no columns."""
        return self.model in LIVOX


@dataclass(frozen=True)
class Scan:
    """One sweep, points in the LiDAR frame.

    Attributes:
        stamp: ns; point i was measured at stamp + dt_ns[i].
        xyz: float64 [N, 3], m; dt_ns: int64 [N]; intensity: float32 [N]; ring: uint16 [N] or None.
    """

    stamp: int
    xyz: np.ndarray
    dt_ns: np.ndarray
    intensity: np.ndarray
    ring: np.ndarray | None

    @property
    def end(self) -> int:
        """Time of the last point, ns."""
        return self.stamp + int(self.dt_ns.max())

    @property
    def middle(self) -> int:
        """Half way between the first and the last point, ns."""
        return self.stamp + (int(self.dt_ns.min()) + int(self.dt_ns.max())) // 2

    def rings(self) -> np.ndarray:
        """The ring of each point; RefusedError where the source has none."""
        if self.ring is None:
            raise RefusedError("the cloud has no rings")
        return self.ring


@dataclass(frozen=True)
class ImuRows:
    """Samples: stamps int64 [N] ns, gyro [N, 3] rad/s, accel [N, 3] m/s^2."""

    stamps: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray

    def __len__(self) -> int:
        return len(self.stamps)


class ImuBuffer:
    """Samples not yet handed to the peer."""

    def __init__(self) -> None:
        self._rows = ImuRows(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))

    def add(self, stamps: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> None:
        """Appends samples, later than all before."""
        old = self._rows
        self._rows = ImuRows(
            np.concatenate([old.stamps, stamps]),
            np.vstack([old.gyro, gyro]),
            np.vstack([old.accel, accel]),
        )

    def take(self, until: int, past: bool = False) -> ImuRows:
        """Removes and gives the samples up to `until` (ns), `past`: and the first one after it."""
        rows = self._rows
        n = int(np.searchsorted(rows.stamps, until, "right")) + int(past)
        self._rows = ImuRows(rows.stamps[n:], rows.gyro[n:], rows.accel[n:])
        return ImuRows(rows.stamps[:n], rows.gyro[:n], rows.accel[:n])


class Driver:
    """Drives one peer; a subclass fills `scan` and, where poses come late, `finish`."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.imu = ImuBuffer()
        self.busy_s = 0.0  # inside the peer since the last reply
        self._origin: int | None = None
        self._T_lidar_imu = np.linalg.inv(setup.T_imu_lidar)

    def scan(self, scan: Scan) -> list[Pose]:
        """Registers a scan; the poses that are ready.

        Raises:
            RefusedError: the peer took nothing from it.
        """
        raise NotImplementedError

    def finish(self) -> list[Pose]:
        """End of input; the poses still to come."""
        return []

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Counts what happens inside as the peer's time."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.busy_s += time.perf_counter() - start

    @contextmanager
    def few_cpus(self) -> Iterator[None]:
        """Inside, only as many processors as threads are allowed.

        TBB asks once, when it is first used, how many there are, and keeps to it: the way to limit
        a peer that has no setting for it. Afterwards the scheduler is free to move us again.
        """
        if not hasattr(os, "sched_setaffinity"):
            yield
            return
        allowed = os.sched_getaffinity(0)
        os.sched_setaffinity(0, sorted(allowed)[: self.setup.threads])
        try:
            yield
        finally:
            os.sched_setaffinity(0, allowed)

    def of_lidar(self, T_map_lidar: np.ndarray) -> np.ndarray:
        """T_map_imu of a LiDAR pose; the map is the IMU's frame at the first scan."""
        return self.setup.T_imu_lidar @ np.asarray(T_map_lidar, float) @ self._T_lidar_imu

    def seconds(self, stamps: Any) -> Any:
        """Stamps (ns) in the peer's clock, s; small numbers, so that floats hold nanoseconds."""
        if self._origin is None:
            self._origin = int(np.min(stamps)) // NS * NS - EPOCH_S * NS
        return (np.asarray(stamps, np.int64) - self._origin) / NS

    def stamp(self, seconds: float) -> int:
        """A time of the peer's clock in ns."""
        assert self._origin is not None
        return round(float(seconds) * NS) + self._origin

    def imu_matrix(self, rows: ImuRows) -> np.ndarray:
        """Columns t ax ay az gx gy gz, as se3-lio and genz-lio take them."""
        return np.ascontiguousarray(np.c_[self.seconds(rows.stamps), rows.accel, rows.gyro])


def rotation(x: float, y: float, z: float, w: float) -> np.ndarray:
    """3x3 of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(position: Any, quaternion_xyzw: Any) -> np.ndarray:
    """4x4 of a position and a unit quaternion."""
    T = np.eye(4)
    T[:3, 3] = position
    T[:3, :3] = rotation(*map(float, quaternion_xyzw))
    return T
