# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Reads IMU and LiDAR topics of a bag."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from d2lio.datasets.bagfile import Message, Topic, expand, open_bag, topic_list
from d2lio.datasets.clocks import ClockCheck
from d2lio.datasets.config import SourceConfig
from d2lio.datasets.events import NS_PER_S, Notes, RawEvent, RawScan
from d2lio.datasets.livox import MESSAGE_TYPES as LIVOX_TYPES
from d2lio.datasets.livox import decode_custom_msg
from d2lio.datasets.ordering import ImuMessage, gather
from d2lio.datasets.pointcloud2 import decode_cloud
from d2lio.datasets.velodyne import MESSAGE_TYPES as VELODYNE_TYPES
from d2lio.datasets.velodyne import decode_velodyne_scan
from d2lio.errors import DataError

CLOUD_TYPES = ("sensor_msgs/msg/PointCloud2", *LIVOX_TYPES, *VELODYNE_TYPES)
IMU_TYPES = ("sensor_msgs/msg/Imu",)
STANDARD_GRAVITY = 9.80665  # m/s^2 per g
UNIT_TOLERANCE = 1e-2  # of a quaternion's norm; single precision and rounding drivers stay below
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


def header_stamp(header: Any) -> int:
    """Stamp of a std_msgs/Header, ns."""
    return int(header.stamp.sec) * NS_PER_S + int(header.stamp.nanosec)


def decode_scan(message: Message, config: SourceConfig, notes: Notes) -> RawScan:
    """Points of a message of one of CLOUD_TYPES; `notes` counts what its packets lack.

    Raises:
        DataError: a message whose sizes or fields contradict each other.
    """
    if message.msgtype in LIVOX_TYPES:
        return decode_custom_msg(message.raw, message.log_stamp, cdr=message.cdr)
    if message.msgtype in VELODYNE_TYPES:
        model = config.lidar.model.lower()
        return decode_velodyne_scan(
            message.raw, message.log_stamp, cdr=message.cdr, model=model, notes=notes
        )
    cloud = message.decode()
    stamp = header_stamp(cloud.header)
    return decode_cloud(cloud, stamp, message.log_stamp, config.lidar.time_field)


def orientation_of(imu: Any) -> tuple[float, float, float, float] | None:
    """x y z w of a sensor_msgs/Imu, None where it has no orientation.

    By the message's definition orientation_covariance[0] == -1 says so. Drivers of 6-axis IMUs
    that do not set it leave zeros or exactly the identity, which no attitude filter gives.
    """
    q = (imu.orientation.x, imu.orientation.y, imu.orientation.z, imu.orientation.w)
    norm = math.sqrt(sum(value * value for value in q))
    unit = abs(norm - 1.0) <= UNIT_TOLERANCE  # False for NaN as well
    if float(imu.orientation_covariance[0]) == -1.0 or not unit or q == NO_ROTATION:
        return None
    return (q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)


class BagReader:
    """ROS 1 bag (or a directory of its shards), ROS 2 bag or MCAP file.

    Opening checks the topics: a wrong name fails at once and lists what is there.

    Raises:
        DataError: unreadable file, or no such topic.
    """

    def __init__(self, path: Path, config: SourceConfig) -> None:
        self._path = path
        self._config = config
        self.notes = Notes()
        self.time_hint = config.time_hint()
        with open_bag(path) as bag:
            topics = bag.topics
        self.lidar_topic = self._choose(topics, config.lidar.topic, CLOUD_TYPES, "lidar")
        self.imu_topic = self._choose(topics, config.imu.topic, IMU_TYPES, "imu")
        if self.lidar_topic.msgtype in VELODYNE_TYPES:  # the decoder's own times
            self.time_hint = replace(self.time_hint, unit="ns", reference="start")

    @property
    def scan_total(self) -> int | None:
        """Number of scans."""
        return self.lidar_topic.count

    @property
    def inputs(self) -> list[str]:
        """Names of the files read."""
        return [p.name for p in expand(self._path)]

    def _choose(
        self, topics: list[Topic], name: str | None, types: tuple[str, ...], what: str
    ) -> Topic:
        if name is not None:
            found = [t for t in topics if t.name == name]
            problem = f"has no topic {name}"
            if found and found[0].msgtype not in types:
                problem = f"topic {name} is a {found[0].msgtype}, not one of {', '.join(types)}"
                found = []
        else:
            found = [t for t in topics if t.msgtype in types and t.count > 0]
            problem = f"has {len(found)} topics that could be {what}.topic (name one)"
        if len(found) != 1:
            raise DataError(f"{self._path}: {problem}; it holds: {topic_list(topics)}")
        if found[0].count == 0:
            raise DataError(f"{self._path}: topic {found[0].name} holds no messages")
        return found[0]

    def raw_events(self) -> Iterator[RawEvent]:
        """Events in order of reception; see `Reader`."""
        yield from gather(self._messages(), self.notes)

    def _messages(self) -> Iterator[ImuMessage | RawScan]:
        check = ClockCheck() if self._config.stamps == "header" else None
        with open_bag(self._path) as bag:
            messages = bag.messages([self.lidar_topic.name, self.imu_topic.name])
            while True:
                try:
                    message = next(messages, None)
                    item = None if message is None else self._decode(message)
                except DataError:
                    raise
                except Exception as err:  # whatever a damaged chunk makes the codecs raise
                    raise DataError(
                        f"{self._path}: damaged after {self.notes.counts.get('scans_read', 0)} "
                        f"scans: {type(err).__name__}: {err}"
                    ) from None
                if item is None:
                    return
                self._check_clock(check, item)
                yield item

    def _check_clock(self, check: ClockCheck | None, item: ImuMessage | RawScan) -> None:
        if check is None:
            return
        compare = check.imu if isinstance(item, ImuMessage) else check.scan
        try:
            note = compare(item.stamp, item.log_stamp)
        except DataError as err:
            raise DataError(f"{self._path}: {err}") from None
        if note:
            self.notes.tell(note)

    def _decode(self, message: Message) -> ImuMessage | RawScan:
        if message.topic == self.imu_topic.name:
            self.notes.count("imu_read")
            return self._decode_imu(message)
        self.notes.count("scans_read")
        return decode_scan(message, self._config, self.notes)

    def _decode_imu(self, message: Message) -> ImuMessage:
        imu = message.decode()
        w, f = imu.angular_velocity, imu.linear_acceleration
        k = STANDARD_GRAVITY if self._config.imu.accel_unit == "g" else 1.0
        log_times = self._config.stamps == "log"
        stamp = message.log_stamp if log_times else header_stamp(imu.header)
        values = (w.x, w.y, w.z, k * f.x, k * f.y, k * f.z)
        orientation = None if self._config.imu.orientation is False else orientation_of(imu)
        return ImuMessage(stamp, message.log_stamp, values, orientation)
