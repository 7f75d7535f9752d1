# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""ROS 1 bag output: PointCloud2 in the Velodyne driver's layout, and Imu."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
     ("time", "<f4")]
)  # fmt: skip
_DATATYPE = {"<f4": 7, "<u2": 4}
_NS = 1_000_000_000


class Orientation(NamedTuple):
    """x y z w of R_world_imu (4,), variances about x, y, z (3,) rad²."""

    quaternion: np.ndarray
    variance: tuple[float, float, float]


class BagWriter:
    """Writes one lidar and one IMU topic; stamps are int64 ns and stay exact."""

    def __init__(self, path: Path, lidar_topic: str, imu_topic: str) -> None:
        """Create the bag at path; messages must then come in order of arrival."""
        self._store = get_typestore(Stores.ROS1_NOETIC)
        self._types = self._store.types
        self._writer = Writer(path)
        self._topics = (lidar_topic, imu_topic)
        self._count = {"lidar": 0, "imu": 0}
        field = self._types["sensor_msgs/msg/PointField"]
        self._fields = [
            field(name=name, offset=POINT.fields[name][1], datatype=_DATATYPE[kind], count=1)
            for name, kind in POINT.descr
        ]

    def __enter__(self) -> BagWriter:
        self._writer.open()
        self._lidar, self._imu = (
            self._writer.add_connection(topic, kind, typestore=self._store)
            for topic, kind in zip(
                self._topics, ("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"), strict=True
            )
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.__exit__(kind, error, trace)

    def _header(self, stream: str, stamp: int, frame: str) -> object:
        time = self._types["builtin_interfaces/msg/Time"](sec=stamp // _NS, nanosec=stamp % _NS)
        sequence = self._count[stream]
        self._count[stream] += 1
        return self._types["std_msgs/msg/Header"](seq=sequence, stamp=time, frame_id=frame)

    def cloud(self, stamp: int, arrival: int, points: np.ndarray) -> None:
        """Write points (n,) of dtype POINT; stamp is the scan start, arrival its end, in ns."""
        message = self._types["sensor_msgs/msg/PointCloud2"](
            header=self._header("lidar", stamp, "lidar"),
            height=1,
            width=len(points),
            fields=self._fields,
            is_bigendian=False,
            point_step=POINT.itemsize,
            row_step=POINT.itemsize * len(points),
            data=points.view(np.uint8),
            is_dense=True,
        )
        data = self._store.serialize_ros1(message, "sensor_msgs/msg/PointCloud2")
        self._writer.write(self._lidar, arrival, data)

    def imu(
        self,
        stamp: int,
        rate: np.ndarray,
        force: np.ndarray,
        variance: tuple[float, float],
        orientation: Orientation | None = None,
    ) -> None:
        """Write one sample: rate (3,) rad/s, force (3,) m/s², variances of the two."""
        types = self._types
        vector = types["geometry_msgs/msg/Vector3"]
        quaternion = types["geometry_msgs/msg/Quaternion"]
        if orientation is None:
            q = np.array([0.0, 0.0, 0.0, 1.0])
            spread = np.zeros(9)
            spread[0] = -1.0  # sensor_msgs/Imu: no orientation estimate
        else:
            q = orientation.quaternion
            spread = np.diag(orientation.variance).ravel()
        message = types["sensor_msgs/msg/Imu"](
            header=self._header("imu", stamp, "imu"),
            orientation=quaternion(x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3])),
            orientation_covariance=spread,
            angular_velocity=vector(*(float(value) for value in rate)),
            angular_velocity_covariance=np.diag([variance[0]] * 3).ravel(),
            linear_acceleration=vector(*(float(value) for value in force)),
            linear_acceleration_covariance=np.diag([variance[1]] * 3).ravel(),
        )
        self._writer.write(
            self._imu, stamp, self._store.serialize_ros1(message, "sensor_msgs/msg/Imu")
        )
