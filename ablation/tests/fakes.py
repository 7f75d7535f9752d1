# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A stand-in for the C++ host: it goes straight ahead and can be told to misbehave."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SPEED = 2.0  # m/s along x


@dataclass
class FakeResult:
    stamp: int
    status: str
    health: str
    has_pose: bool
    T_map_imu: np.ndarray
    diagnostics: dict[str, float | int | str] = field(default_factory=dict)


class FakeHost:
    """Offers the interface of `d2lio.hosts.Host`.

    Parameters: `fake.nan_at` makes that pose NaN, `fake.raise_at` raises KeyboardInterrupt
    there; the first scan is INIT. Unknown `fake.` keys are refused.
    """

    KEYS = ("fake.nan_at", "fake.interrupt_at")

    def __init__(self, params: dict[str, str], threads: int = 1) -> None:
        self.params = dict(params)
        self.threads = threads
        self._nan_at = int(params.get("fake.nan_at", -1))
        self._interrupt_at = int(params.get("fake.interrupt_at", -1))
        self._scans: list[tuple[int, int, int]] = []
        self._newest_imu = -1
        self._finished = False
        self._done = 0
        self.imu_samples = 0
        self.orientations = 0

    @staticmethod
    def describe() -> list[dict[str, str]]:
        return [
            {
                "key": key,
                "type": "int",
                "default": "-1",
                "range": ">= -1",
                "unit": "",
                "doc": "where | to fail",
            }
            for key in FakeHost.KEYS
        ]

    def add_imu(
        self,
        stamps: np.ndarray,
        gyro: np.ndarray,
        accel: np.ndarray,
        orientation: np.ndarray | None = None,
    ) -> None:
        assert gyro.shape == accel.shape == (len(stamps), 3)
        assert orientation is None or orientation.shape == (len(stamps), 4)
        self.orientations += 0 if orientation is None else int(orientation.any(axis=1).sum())
        self.imu_samples += len(stamps)
        self._newest_imu = int(stamps[-1])

    def add_scan(self, stamp, xyz, dt_ns, intensity, ring) -> None:
        assert xyz.dtype == np.float32
        assert dt_ns.dtype == np.int32
        assert len(xyz) == len(dt_ns)
        self._scans.append((stamp, stamp + int(dt_ns.max()), len(xyz)))

    def step(self) -> FakeResult | None:
        ready = self._scans and (self._finished or self._newest_imu >= self._scans[0][1])
        if not ready:
            return None
        _, end, points = self._scans.pop(0)
        index, self._done = self._done, self._done + 1
        if index == self._interrupt_at:
            raise KeyboardInterrupt
        if index == 0:
            self._start = end
        pose = np.eye(4)
        pose[0, 3] = np.nan if index == self._nan_at else SPEED * (end - self._start) * 1e-9
        health = "INIT" if index == 0 else "OK"
        row = {
            "stamp_ns": end,
            "status": "ok",
            "health": health,
            "points_raw": points,
            "offered": 10,
            "accepted": 8,
            "rejected_threshold": 2,
            "epsilon_min": 0.1,
            "epsilon_median": 0.2,
            "epsilon_max": 0.3,
            "lambda_t_1": 5.0,
            "lambda_r_1": 50.0,
            "time_total_ms": 1.0 + index,
        }
        return FakeResult(end, "ok", health, index > 0, pose, row)

    def finish(self) -> None:
        self._finished = True

    def map_points(self) -> np.ndarray:
        return np.zeros((0, 3), np.float32)

    def counts(self) -> dict[str, int]:
        return {"epochs": 1, "scans_dropped_late": 0, "orientations": self.orientations}
