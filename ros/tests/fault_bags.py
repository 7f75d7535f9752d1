# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Bags with faults, made from a simulated one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS1_NOETIC)
CLOUD, IMU = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"
NS = 1_000_000_000

Message = tuple[str, int, Any]  # type, time of reception in ns, deserialised message


def read(bag: Path) -> list[Message]:
    """Every message of a bag, in order of reception."""
    with Reader(bag) as reader:
        return [
            (c.msgtype, stamp, STORE.deserialize_ros1(raw, c.msgtype))
            for c, stamp, raw in reader.messages()
        ]


def write(bag: Path, messages: Iterable[Message], topics: dict[str, str]) -> Path:
    """Writes messages to the topic of their type; `topics` by message type."""
    with Writer(bag) as writer:
        places = {k: writer.add_connection(t, k, typestore=STORE) for k, t in topics.items()}
        for kind, stamp, message in messages:
            writer.write(places[kind], stamp, STORE.serialize_ros1(message, kind))
    return bag


def changed_clouds(messages: list[Message], change: Callable[[int, Any], Any]) -> list[Message]:
    """The messages, every cloud replaced by `change(its number, cloud)`."""
    out, number = [], 0
    for kind, stamp, message in messages:
        if kind == CLOUD:
            message = change(number, message)
            number += 1
        out.append((kind, stamp, message))
    return out


def without_imu(messages: list[Message], begin_s: float, length_s: float) -> list[Message]:
    """The messages without the IMU's from `begin_s` on, for `length_s`."""
    first = messages[0][1]
    cut = (first + begin_s * NS, first + (begin_s + length_s) * NS)
    return [m for m in messages if m[0] != IMU or not cut[0] <= m[1] < cut[1]]


def without_times(_number: int, cloud: Any) -> Any:
    """The cloud with its time field renamed to one that nobody knows."""
    field = STORE.types["sensor_msgs/msg/PointField"]
    names = {"time": "unknown"}
    cloud.fields = [
        field(name=names.get(f.name, f.name), offset=f.offset, datatype=f.datatype, count=f.count)
        for f in cloud.fields
    ]
    return cloud


def with_nan(_number: int, cloud: Any) -> Any:
    """The cloud with every tenth point NaN, and is_dense true as drivers claim."""
    data = np.array(cloud.data).reshape(-1, cloud.point_step)
    data[::10, :12] = np.frombuffer(np.full(3, np.nan, np.float32).tobytes(), np.uint8)
    cloud.data = data.ravel()
    return cloud


def emptied(number: int, cloud: Any) -> Any:
    """Every third cloud without a point."""
    if number % 3 == 1:
        cloud.width = cloud.row_step = 0
        cloud.data = np.empty(0, np.uint8)
    return cloud
