# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Notices IMU and LiDAR stamps that come from clocks which never meet."""

from __future__ import annotations

from d2lio.datasets.events import NS_PER_S
from d2lio.errors import DataError

APART_ERROR_S = 10.0  # no driver delays one stream against the other by this much
APART_NOTE_S = 1.0


class ClockCheck:
    """Compares (stamp - time of reception) of both streams as soon as both have been seen."""

    def __init__(self) -> None:
        self._imu: tuple[int, int] | None = None
        self._scan: tuple[int, int] | None = None
        self._done = False

    def imu(self, stamp: int, log_stamp: int) -> str | None:
        """Takes an IMU stamp, ns; see `_compare`."""
        self._imu = self._imu or (stamp, log_stamp)
        return self._compare()

    def scan(self, stamp: int, log_stamp: int) -> str | None:
        """Takes a scan stamp, ns; see `_compare`."""
        self._scan = self._scan or (stamp, log_stamp)
        return self._compare()

    def _compare(self) -> str | None:
        """A note where the clocks look shifted.

        Raises:
            DataError: the clocks cannot be the same.
        """
        if self._done or self._imu is None or self._scan is None:
            return None
        self._done = True
        apart = ((self._imu[0] - self._imu[1]) - (self._scan[0] - self._scan[1])) / NS_PER_S
        if abs(apart) > APART_ERROR_S:
            raise DataError(
                "IMU and LiDAR stamps come from different clocks: the first IMU header says "
                f"{self._imu[0] / NS_PER_S:.3f} s, the first cloud header "
                f"{self._scan[0] / NS_PER_S:.3f} s, while the recorder received them at "
                f"{self._imu[1] / NS_PER_S:.3f} s and {self._scan[1] / NS_PER_S:.3f} s. "
                "`--stamps log` takes the times of reception instead "
                "(less exact: they contain the drivers' delays)"
            )
        if abs(apart) > APART_NOTE_S:
            return f"IMU and LiDAR headers lie {apart:+.2f} s apart for messages received together"
        return None
