# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""sensor_msgs/PointCloud2 to arrays, whatever the order, padding and type of its fields."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from d2lio.datasets.events import RawScan
from d2lio.errors import DataError

TIME_FIELDS = ("time", "t", "timestamp", "offset_time", "time_stamp")
RING_FIELDS = ("ring", "channel", "line")
INTENSITY_FIELDS = ("intensity", "reflectivity")

# sensor_msgs/PointField datatype constants.
_FORMATS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@lru_cache(maxsize=16)
def _point_dtype(
    fields: tuple[tuple[str, int, int, int], ...], point_step: int, big_endian: bool
) -> np.dtype:
    """Structured dtype of one point; `fields` holds (name, offset, datatype, count)."""
    order = ">" if big_endian else "<"
    names, formats, offsets = [], [], []
    for name, offset, datatype, count in fields:
        if datatype not in _FORMATS:
            raise DataError(f"PointCloud2 field '{name}' has unknown datatype {datatype}")
        base = order + _FORMATS[datatype]
        if offset + np.dtype(base).itemsize * max(count, 1) > point_step:
            raise DataError(f"PointCloud2 field '{name}' reaches beyond point_step {point_step}")
        names.append(name)
        formats.append(base if count <= 1 else (base, (count,)))
        offsets.append(offset)
    return np.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": point_step}
    )


def _first_of(names: Sequence[str], available: tuple[str, ...]) -> str | None:
    return next((name for name in names if name in available), None)


def cloud_array(msg: Any) -> np.ndarray:
    """Structured view [N] of the points, in memory order.

    Raises:
        DataError: sizes that contradict each other.
    """
    fields = tuple((f.name, int(f.offset), int(f.datatype), int(f.count)) for f in msg.fields)
    dtype = _point_dtype(fields, int(msg.point_step), bool(msg.is_bigendian))
    height, width = int(msg.height), int(msg.width)
    row_step = int(msg.row_step) or width * dtype.itemsize
    data = np.ascontiguousarray(np.asarray(msg.data).view(np.uint8))
    if height * width == 0:
        return np.empty(0, dtype)
    if row_step < width * dtype.itemsize or len(data) < height * row_step:
        raise DataError(
            f"PointCloud2 claims {height} x {width} points of {dtype.itemsize} bytes "
            f"(row_step {row_step}) but holds {len(data)} bytes"
        )
    grid = np.ndarray((height, width), dtype, data, strides=(row_step, dtype.itemsize))
    return grid.reshape(-1)


def decode_cloud(msg: Any, stamp: int, log_stamp: int, time_field: str | None = None) -> RawScan:
    """Arrays of one PointCloud2 message.

    Args:
        msg: deserialised message.
        stamp: its header stamp, ns.
        log_stamp: time of reception, ns.
        time_field: name of the per-point time field; None takes the first of TIME_FIELDS.

    Raises:
        DataError: no x, y, z; a named time field that is not there; contradicting sizes.
    """
    points = cloud_array(msg)
    names = points.dtype.names or ()
    missing = [axis for axis in "xyz" if axis not in names]
    if missing:
        raise DataError(f"PointCloud2 has no field {missing[0]}; it holds {', '.join(names)}")
    if time_field is not None and time_field not in names:
        known = ", ".join(names)
        raise DataError(f"PointCloud2 has no time field '{time_field}'; it holds {known}")
    xyz = np.empty((len(points), 3), np.float32)
    for column, axis in enumerate("xyz"):
        xyz[:, column] = points[axis]
    time_name = time_field or _first_of(TIME_FIELDS, names)
    ring_name = _first_of(RING_FIELDS, names)
    intensity_name = _first_of(INTENSITY_FIELDS, names)
    return RawScan(
        stamp=stamp,
        log_stamp=log_stamp,
        xyz=xyz,
        times=_native(points[time_name]) if time_name else None,
        intensity=points[intensity_name].astype(np.float32) if intensity_name else None,
        ring=points[ring_name].astype(np.uint16) if ring_name else None,
    )


def _native(values: np.ndarray) -> np.ndarray:
    """Contiguous copy in this machine's byte order."""
    return values.astype(values.dtype.newbyteorder("="))
