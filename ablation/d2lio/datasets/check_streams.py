# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What `d2lio datasets check` measures of each topic."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from d2lio.datasets.bag import IMU_TYPES, decode_scan, header_stamp
from d2lio.datasets.bagfile import BagFile, Message
from d2lio.datasets.config import SourceConfig
from d2lio.datasets.events import NS_PER_S, Notes, RawScan, TimeHint
from d2lio.datasets.timing import TimeResolver
from d2lio.errors import DataError

GAP_PERIODS = 3.0


@dataclass(slots=True)
class Stream:
    """Stamps of a topic: header and time of reception, ns, in order of reception."""

    stamps: list[int] = field(default_factory=list)
    logs: list[int] = field(default_factory=list)

    def add(self, stamp: int, log_stamp: int) -> None:
        """Takes one message."""
        self.stamps.append(stamp)
        self.logs.append(log_stamp)

    def __len__(self) -> int:
        return len(self.stamps)

    def steps_s(self) -> np.ndarray:
        """float64 [N - 1], from one header stamp to the next, s."""
        return np.diff(np.array(self.stamps, np.int64)) / NS_PER_S

    @property
    def rate_hz(self) -> float | None:
        """From the median step, None where there is none."""
        steps = self.steps_s()
        steps = steps[steps > 0.0]
        return float(1.0 / np.median(steps)) if len(steps) else None

    @property
    def clock_s(self) -> float:
        """Median of header stamp minus time of reception, s."""
        return float(np.median(np.subtract(self.stamps, self.logs, dtype=np.int64))) / NS_PER_S

    def gaps_s(self, period_s: float) -> np.ndarray:
        """Steps longer than GAP_PERIODS periods, s."""
        steps = self.steps_s()
        return steps[steps > GAP_PERIODS * period_s]


@dataclass(slots=True)
class ImuStream(Stream):
    """Stamps and the length of each acceleration, as stored."""

    accel: list[float] = field(default_factory=list)

    def take(self, message: Message) -> None:
        """Takes one sensor_msgs/Imu."""
        imu = message.decode()
        a = imu.linear_acceleration
        self.add(header_stamp(imu.header), message.log_stamp)
        self.accel.append(math.sqrt(a.x * a.x + a.y * a.y + a.z * a.z))

    @property
    def accel_norm(self) -> float:
        """Median length of the acceleration, in its own unit."""
        return float(np.median(self.accel)) if self.accel else math.nan


@dataclass(slots=True)
class LidarStream(Stream):
    """Stamps, shares of bad points and the convention of the point times."""

    config: SourceConfig = field(default_factory=SourceConfig)
    topic: str = ""
    notes: Notes = field(default_factory=Notes)
    points: int = 0
    nan: int = 0
    zero: int = 0
    rings: int = 0
    time_range: tuple[float, float] | None = None
    time_type: str = ""
    time_error: str = ""
    has_times: bool = True
    resolver: TimeResolver | None = None

    def take(self, message: Message) -> None:
        """Takes one scan of any type.

        Raises:
            DataError: a message that contradicts itself.
        """
        scan = decode_scan(message, self.config, self.notes)
        self.add(scan.stamp, message.log_stamp)
        finite = np.isfinite(scan.xyz).all(axis=1)
        self.points += len(scan)
        self.nan += int((~finite).sum())
        self.zero += int((finite & ~scan.xyz.any(axis=1)).sum())
        if scan.ring is not None and len(scan):
            self.rings = max(self.rings, int(scan.ring.max()) + 1)
        self._take_times(scan)

    def _take_times(self, scan: RawScan) -> None:
        if scan.times is None:
            self.has_times = False
            return
        if self.time_range is None and len(scan):
            self.time_range = (float(scan.times.min()), float(scan.times.max()))
            self.time_type = str(scan.times.dtype)
        if self.time_error:
            return
        if self.resolver is None:
            period = 1.0 / self.config.lidar.rate_hz
            self.resolver = TimeResolver(TimeHint(period_s=period), self.notes)
        try:
            self.resolver.resolve(scan)
        except DataError as err:
            self.time_error = str(err)

    @property
    def found(self) -> TimeHint | None:
        """Unit and reference of the point times, None before a scan showed them."""
        return self.resolver.found if self.resolver else None


@dataclass(slots=True)
class Measured:
    """Streams of a recording; `damage` says why reading ended early, `seconds` how far it came."""

    lidar: LidarStream | None
    imus: dict[str, ImuStream]
    seconds: float = 0.0
    damage: str = ""


def measure(
    bag: BagFile,
    lidar_topic: str | None,
    config: SourceConfig,
    limit_s: float | None,
    progress: Callable[[float, float], None] | None = None,
) -> Measured:
    """Reads the LiDAR topic and every IMU topic for `limit_s` seconds of reception, None for all.

    What a damaged chunk makes the codecs raise ends the reading and is told, not raised.
    """
    imus = {t.name: ImuStream() for t in bag.topics if t.msgtype in IMU_TYPES and t.count}
    lidar = None if lidar_topic is None else LidarStream(config=config, topic=lidar_topic)
    result = Measured(lidar, imus)
    total = (bag.end - bag.begin) / NS_PER_S
    messages = bag.messages([*imus, *([lidar_topic] if lidar_topic else [])])
    try:
        for count, message in enumerate(messages):
            result.seconds = (message.log_stamp - bag.begin) / NS_PER_S
            if limit_s is not None and result.seconds > limit_s:
                break
            if progress is not None and count % 200 == 0:
                progress(result.seconds, min(total, limit_s or total))
            if message.topic in imus:
                imus[message.topic].take(message)
            elif lidar is not None:
                lidar.take(message)
    except Exception as err:
        result.damage = (
            f"{type(err).__name__}: {err}" if not isinstance(err, DataError) else f"{err}"
        )
    return result
