# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What every reader yields: blocks of IMU samples and scans, in order of arrival."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

Int64 = npt.NDArray[np.int64]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class ImuBlock:
    """Consecutive IMU samples in the IMU frame.

    Attributes:
        stamps: int64 [N], ns.
        gyro: float64 [N, 3], angular rate, rad/s.
        accel: float64 [N, 3], specific force, m/s^2 (+g upwards at rest).
        orientation: float64 [N, 4], x y z w of R_world_imu of a 9-axis IMU, rows of zeros where a
            sample has none; None where no sample has one.
    """

    stamps: Int64
    gyro: Float64
    accel: Float64
    orientation: Float64 | None = None

    def __len__(self) -> int:
        return len(self.stamps)


@dataclass(frozen=True, slots=True)
class RawScan:
    """One sweep as its message holds it, in message order, LiDAR frame.

    Attributes:
        stamp: the message's own stamp, ns; what it means (start, end) depends on the driver.
        log_stamp: time of reception, ns.
        xyz: float32 [N, 3], m; may hold NaN.
        times: [N] per-point time field as stored (any unit, any number type), None if absent.
        intensity: float32 [N], sensor units, or None.
        ring: uint16 [N], beam index, or None.
    """

    stamp: int
    log_stamp: int
    xyz: Float32
    times: np.ndarray | None = None
    intensity: Float32 | None = None
    ring: npt.NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.xyz)


@dataclass(frozen=True, slots=True)
class Scan:
    """One sweep with resolved point times: point i was measured at `stamp + dt_ns[i]`."""

    stamp: int
    xyz: Float32
    dt_ns: npt.NDArray[np.int32]
    intensity: Float32 | None = None
    ring: npt.NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.xyz)


@dataclass(frozen=True, slots=True)
class TimeHint:
    """What is known about the per-point time field; "auto" lets the data decide.

    Attributes:
        unit: auto, s, ms, us or ns.
        reference: auto, start, end (offset from the stamp) or absolute.
        period_s: nominal sweep time, s.
        synchronised: the points are already moved to the stamp (motion compensated).
        pseudo: points without times may get times from their azimuth.
    """

    unit: str = "auto"
    reference: str = "auto"
    period_s: float = 0.1
    synchronised: bool = False
    pseudo: bool = False


@dataclass(slots=True)
class Notes:
    """Messages worth telling once each, and counts of what was dropped."""

    messages: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)

    def tell(self, message: str) -> None:
        """Keeps a message once."""
        if message not in self.messages:
            self.messages.append(message)

    def count(self, reason: str, number: int = 1) -> None:
        """Adds to the count of a reason."""
        self.counts[reason] = self.counts.get(reason, 0) + number


RawEvent = ImuBlock | RawScan
Event = ImuBlock | Scan


class Reader(Protocol):
    """A recorded data set. `raw_events` may be called once; memory stays bounded."""

    time_hint: TimeHint
    notes: Notes

    @property
    def scan_total(self) -> int | None:
        """Number of scans, None if unknown without reading everything."""

    @property
    def inputs(self) -> list[str]:
        """Names of the files read."""

    def raw_events(self) -> Iterator[RawEvent]:
        """Events in order of arrival.

        Raises:
            d2lio.errors.DataError: unreadable input, with the reason.
        """
