# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""livox_ros_driver/CustomMsg from its serialised bytes.

A generic deserialiser makes one object per point (24 000 a scan); the layout is fixed, so a
structured view does it at once.
"""

from __future__ import annotations

import struct

import numpy as np

from d2lio.datasets.events import NS_PER_S, RawScan
from d2lio.errors import DataError

MESSAGE_TYPES = (
    "livox_ros_driver/msg/CustomMsg",
    "livox_ros_driver2/msg/CustomMsg",
)

_FIELDS = [
    ("offset_time", "<u4"),
    ("x", "<f4"),
    ("y", "<f4"),
    ("z", "<f4"),
    ("reflectivity", "u1"),
    ("tag", "u1"),
    ("line", "u1"),
]
_POINT = np.dtype(_FIELDS)  # ROS 1: packed, 19 bytes
_POINT_CDR = np.dtype([*_FIELDS, ("padding", "u1")])  # ROS 2: aligned to 4, 20 bytes


def _read_ros1(raw: bytes) -> tuple[int, int, bytes]:
    """Header stamp [ns], number of points, their bytes."""
    _, sec, nsec, frame_size = struct.unpack_from("<4I", raw)
    # timebase u64, point_num u32, lidar_id u8, reserved u8[3]
    offset = 16 + frame_size + 8 + 4 + 4
    (count,) = struct.unpack_from("<I", raw, offset)
    return sec * NS_PER_S + nsec, count, raw[offset + 4 :]


def _read_cdr(raw: bytes) -> tuple[int, int, bytes]:
    """As `_read_ros1`, for the CDR encoding (alignment counts from byte 4)."""
    body = raw[4:]
    sec, nsec, frame_size = struct.unpack_from("<iII", body)
    offset = 12 + frame_size
    offset = (offset + 7) // 8 * 8 + 8 + 4 + 4
    (count,) = struct.unpack_from("<I", body, offset)
    return sec * NS_PER_S + nsec, count, body[offset + 4 :]


def decode_custom_msg(raw: bytes, log_stamp: int, *, cdr: bool = False) -> RawScan:
    """Arrays of one CustomMsg; `times` are ns from the header stamp (the scan's start).

    Raises:
        DataError: fewer bytes than the point count asks for.
    """
    raw = bytes(raw)
    try:
        stamp, count, data = (_read_cdr if cdr else _read_ros1)(raw)
    except struct.error as err:
        raise DataError(f"CustomMsg of {len(raw)} bytes is truncated") from err
    dtype = _POINT_CDR if cdr else _POINT
    size = count * dtype.itemsize
    # CDR pads between the points, not after the last one.
    if len(data) < size - (1 if cdr and count else 0):
        raise DataError(f"CustomMsg claims {count} points but holds only {len(raw)} bytes")
    if len(data) < size:
        data += b"\0"
    points = np.frombuffer(data, dtype, count)
    xyz = np.stack([points["x"], points["y"], points["z"]], axis=1)
    return RawScan(
        stamp=stamp,
        log_stamp=log_stamp,
        xyz=xyz,
        times=points["offset_time"].copy(),
        intensity=points["reflectivity"].astype(np.float32),
        ring=points["line"].astype(np.uint16),
    )
