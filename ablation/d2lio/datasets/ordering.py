# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Gathers messages into blocks and puts slightly late ones back in order, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from d2lio.datasets.events import NS_PER_S, ImuBlock, Notes, RawEvent, RawScan

JUMP_BACK_S = 1.0  # stamps that fall back further than this begin a new epoch (a looped bag)
SCANS_HELD = 2  # scans waiting for an earlier-stamped one that arrives late
IMU_HELD = 8  # the same for IMU samples
MAX_IMU_BLOCK = 1024  # samples


@dataclass(frozen=True, slots=True)
class ImuMessage:
    """One IMU sample: stamp in ns, (gyro x y z, accel x y z) in rad/s and m/s^2.

    `orientation` is x y z w of R_world_imu, None for a 6-axis IMU.
    """

    stamp: int
    log_stamp: int
    values: tuple[float, float, float, float, float, float]
    orientation: tuple[float, float, float, float] | None = None


class _Gatherer:
    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._imu: list[ImuMessage] = []
        self._scans: list[RawScan] = []
        self._newest_imu: int | None = None
        self._newest_scan: int | None = None

    def add_imu(self, message: ImuMessage) -> Iterator[RawEvent]:
        if self._jumped(self._newest_imu, message.stamp, "IMU"):
            yield from self.flush()
            self._newest_scan = None
        elif self._newest_imu is not None and message.stamp < self._newest_imu:
            self._notes.count("imu_out_of_order")
        self._newest_imu = message.stamp
        self._imu.append(message)
        if len(self._imu) >= MAX_IMU_BLOCK:
            yield from self._flush_imu(IMU_HELD)

    def add_scan(self, scan: RawScan) -> Iterator[RawEvent]:
        if self._jumped(self._newest_scan, scan.stamp, "scan"):
            yield from self.flush()
            self._newest_imu = None
        elif self._newest_scan is not None and scan.stamp < self._newest_scan:
            self._notes.count("scans_out_of_order")
        self._newest_scan = max(scan.stamp, self._newest_scan or scan.stamp)
        yield from self._flush_imu(IMU_HELD)
        self._scans.append(scan)
        self._scans.sort(key=lambda s: s.stamp)
        while len(self._scans) > SCANS_HELD:
            yield self._scans.pop(0)

    def flush(self) -> Iterator[RawEvent]:
        yield from self._flush_imu()
        yield from self._scans
        self._scans = []

    def _jumped(self, newest: int | None, stamp: int, what: str) -> bool:
        back = 0 if newest is None else newest - stamp
        if back <= JUMP_BACK_S * NS_PER_S:
            return False
        self._notes.count("jumps_back")
        self._notes.tell(f"{what} stamps jump back by {back / NS_PER_S:.1f} s: a new epoch begins")
        return True

    def _flush_imu(self, held: int = 0) -> Iterator[RawEvent]:
        # Stable, so that duplicates keep their order of arrival.
        ordered = sorted(self._imu, key=lambda m: m.stamp)
        ready = len(ordered) - held
        if ready <= 0:
            return
        ordered, self._imu = ordered[:ready], ordered[ready:]
        values = np.array([m.values for m in ordered], np.float64)
        stamps = np.array([m.stamp for m in ordered], np.int64)
        yield ImuBlock(stamps, values[:, :3].copy(), values[:, 3:].copy(), _orientation(ordered))


def _orientation(messages: list[ImuMessage]) -> np.ndarray | None:
    """x y z w [N, 4], zeros where a message has none; None where none has."""
    if all(m.orientation is None for m in messages):
        return None
    return np.array([m.orientation or (0.0, 0.0, 0.0, 0.0) for m in messages], np.float64)


def gather(messages: Iterable[ImuMessage | RawScan], notes: Notes) -> Iterator[RawEvent]:
    """Blocks of IMU samples and scans; each scan follows the IMU samples received before it.

    Scans up to SCANS_HELD places late, and IMU samples up to IMU_HELD late, return to their
    place; stamps falling back by more than JUMP_BACK_S end the epoch and are passed on as they
    come. What is later still reaches the host, which drops and counts it.
    """
    gatherer = _Gatherer(notes)
    for message in messages:
        if isinstance(message, ImuMessage):
            yield from gatherer.add_imu(message)
        else:
            yield from gatherer.add_scan(message)
    yield from gatherer.flush()
