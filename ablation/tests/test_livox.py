# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Livox CustomMsg in both encodings."""

from __future__ import annotations

import numpy as np
import pytest
from bags import CUSTOM_MSG, CUSTOM_POINT, header, ros1_store
from d2lio.datasets.livox import decode_custom_msg
from d2lio.errors import DataError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STAMP = 1_700_000_000_123_456_789
TYPE = "livox_ros_driver/msg/CustomMsg"


def message(store, count: int = 5, frame: str = "livox_frame"):
    point = store.types["livox_ros_driver/msg/CustomPoint"]
    points = [point(i * 1000, i + 0.5, -i, 2.0 * i, 10 + i, 16, i % 6) for i in range(count)]
    return store.types[TYPE](
        header(store, STAMP, frame), STAMP, count, 1, np.zeros(3, np.uint8), points
    )


def ros2_store():
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = get_types_from_msg(CUSTOM_POINT, "livox_ros_driver/msg/CustomPoint")
    types.update(get_types_from_msg(CUSTOM_MSG, TYPE))
    store.register(types)
    return store


@pytest.mark.parametrize("frame", ["livox_frame", "f", "four", ""])
@pytest.mark.parametrize("cdr", [False, True])
def test_points_times_and_lines(cdr: bool, frame: str) -> None:
    store = ros2_store() if cdr else ros1_store()
    raw = (store.serialize_cdr if cdr else store.serialize_ros1)(message(store, 5, frame), TYPE)
    scan = decode_custom_msg(raw, 7, cdr=cdr)
    assert (scan.stamp, scan.log_stamp) == (STAMP, 7)
    np.testing.assert_array_equal(scan.xyz[:, 0], np.arange(5) + np.float32(0.5))
    np.testing.assert_array_equal(scan.xyz[:, 2], 2.0 * np.arange(5))
    assert scan.times.tolist() == [0, 1000, 2000, 3000, 4000]
    assert scan.ring.tolist() == [0, 1, 2, 3, 4]
    assert scan.intensity.tolist() == [10, 11, 12, 13, 14]


@pytest.mark.parametrize("cdr", [False, True])
def test_truncated_message_is_refused(cdr: bool) -> None:
    store = ros2_store() if cdr else ros1_store()
    raw = (store.serialize_cdr if cdr else store.serialize_ros1)(message(store), TYPE)
    with pytest.raises(DataError, match=r"truncated|claims 5 points"):
        decode_custom_msg(raw[:-19], 0, cdr=cdr)
    with pytest.raises(DataError, match="truncated"):
        decode_custom_msg(raw[:10], 0, cdr=cdr)
