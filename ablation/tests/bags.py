# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Small ROS bags with known contents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NS = 1_000_000_000
START = 1_700_000_000 * NS + 123_456_789
FORMATS = {"f4": 7, "f8": 8, "u1": 2, "u2": 4, "u4": 6, "i4": 5}

CUSTOM_POINT = (
    "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\n"
    "uint8 line\n"
)
CUSTOM_MSG = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
    "livox_ros_driver/CustomPoint[] points\n"
)


def ros1_store():
    store = get_typestore(Stores.ROS1_NOETIC)
    types = get_types_from_msg(CUSTOM_POINT, "livox_ros_driver/msg/CustomPoint")
    types.update(get_types_from_msg(CUSTOM_MSG, "livox_ros_driver/msg/CustomMsg"))
    store.register(types)
    return store


def header(store, stamp: int, frame: str = "lidar"):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](stamp // NS, stamp % NS)
    if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__:
        return types["std_msgs/msg/Header"](0, time, frame)
    return types["std_msgs/msg/Header"](time, frame)


def imu_message(
    store,
    stamp: int,
    gyro=(0.0, 0.0, 0.0),
    accel=(0.0, 0.0, 9.81),
    orientation=(0.0, 0.0, 0.0, 1.0),
    orientation_variance: float = 0.0,
):
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    return types["sensor_msgs/msg/Imu"](
        header(store, stamp, "imu"),
        types["geometry_msgs/msg/Quaternion"](*orientation),
        np.diag([orientation_variance] * 3).ravel(),
        vector(*gyro),
        np.zeros(9),
        vector(*accel),
        np.zeros(9),
    )


def cloud_message(
    store,
    stamp: int,
    points: np.ndarray,
    *,
    height: int = 1,
    row_padding: int = 0,
    fields: Sequence[str] | None = None,
):
    """A PointCloud2 out of a structured array, its dtype giving offsets, padding, endianness."""
    types = store.types
    dtype = points.dtype
    names = list(fields or dtype.names)
    described = []
    for name in names:
        kind, offset = dtype.fields[name]
        described.append(
            types["sensor_msgs/msg/PointField"](name, offset, FORMATS[kind.base.str[1:]], 1)
        )
    width = len(points) // height
    rows = points.reshape(height, width)
    data = b"".join(row.tobytes() + b"\xaa" * row_padding for row in rows)
    big = any(dtype.fields[n][0].base.str[0] == ">" for n in names)
    return types["sensor_msgs/msg/PointCloud2"](
        header(store, stamp),
        height,
        width,
        described,
        big,
        dtype.itemsize,
        width * dtype.itemsize + row_padding,
        np.frombuffer(data, np.uint8),
        False,
    )


VELODYNE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
     ("time", "<f4")]
)  # fmt: skip


def velodyne_points(count: int = 160, seed: int = 0, begin: float = 0.0) -> np.ndarray:
    """Points in column order, times over 0.1 s from `begin`."""
    rng = np.random.default_rng(seed)
    points = np.zeros(count, VELODYNE)
    for axis in "xyz":
        points[axis] = rng.normal(0.0, 10.0, count)
    points["ring"] = np.arange(count) % 16
    points["time"] = begin + np.linspace(0.0, 0.0999, count)
    return points


@dataclass
class Recorded:
    """A message to be written: receive time, topic, type, message."""

    log: int
    topic: str
    msgtype: str
    message: object


def write_bag(path: Path, messages: list[Recorded], store=None) -> Path:
    store = store or ros1_store()
    with Writer(path) as writer:
        connections = {}
        for item in messages:
            if item.topic not in connections:
                connections[item.topic] = writer.add_connection(
                    item.topic, item.msgtype, typestore=store
                )
            raw = store.serialize_ros1(item.message, item.msgtype)
            writer.write(connections[item.topic], item.log, raw)
    return path


IMU = "sensor_msgs/msg/Imu"
CLOUD = "sensor_msgs/msg/PointCloud2"


def drive(
    scans: int = 5, *, imu_hz: int = 100, imu_clock: int = 0, begin: int = START, store=None
) -> list[Recorded]:
    """Scans at 10 Hz with IMU around them; `imu_clock` shifts the IMU's header stamps, ns."""
    store = store or ros1_store()
    messages = []
    period = NS // imu_hz
    for stamp in range(begin - NS // 5, begin + scans * NS // 10 + NS // 5, period):
        message = imu_message(store, stamp + imu_clock)
        messages.append(Recorded(stamp, "/imu/data", IMU, message))
    for index in range(scans):
        stamp = begin + index * NS // 10
        message = cloud_message(store, stamp, velodyne_points(seed=index))
        messages.append(Recorded(stamp + NS // 10, "/lidar/points", CLOUD, message))
    return sorted(messages, key=lambda m: m.log)
