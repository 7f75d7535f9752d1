# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""PointCloud2 decoding: any order, padding, endianness, number types."""

from __future__ import annotations

import numpy as np
import pytest
from bags import VELODYNE, cloud_message, ros1_store, velodyne_points
from d2lio.datasets.pointcloud2 import decode_cloud
from d2lio.errors import DataError

STORE = ros1_store()


def reordered(points: np.ndarray, dtype: np.dtype) -> np.ndarray:
    out = np.zeros(len(points), dtype)
    for name in dtype.names:
        out[name] = points[name]
    return out


LAYOUTS = {
    "velodyne packed": VELODYNE,
    "time first": np.dtype(
        [("time", "<f4"), ("z", "<f4"), ("x", "<f4"), ("ring", "<u2"), ("y", "<f4"),
         ("intensity", "<f4")]
    ),
    "padded": np.dtype(
        {
            "names": ["x", "y", "z", "intensity", "time", "ring"],
            "formats": ["<f4", "<f4", "<f4", "<f4", "<f4", "u1"],
            "offsets": [0, 4, 8, 16, 20, 26],
            "itemsize": 48,
        }
    ),
    "big endian": np.dtype(
        [("x", ">f4"), ("y", ">f4"), ("z", ">f4"), ("intensity", ">f4"), ("ring", ">u2"),
         ("time", ">f8")]
    ),
    "doubles": np.dtype(
        [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4"), ("ring", "<u2"),
         ("time", "<f8")]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("row_padding", [0, 7])
def test_every_layout_gives_the_same_points(name: str, row_padding: int) -> None:
    points = velodyne_points(160)
    stored = reordered(points, LAYOUTS[name])
    message = cloud_message(STORE, 5, stored, height=4, row_padding=row_padding)
    scan = decode_cloud(message, 5, 6)
    assert scan.stamp == 5
    assert scan.xyz.dtype == np.float32
    np.testing.assert_array_equal(scan.xyz[:, 1], points["y"])
    np.testing.assert_array_equal(scan.times, points["time"].astype(scan.times.dtype))
    assert scan.times.dtype.isnative
    np.testing.assert_array_equal(scan.ring, points["ring"])


@pytest.mark.parametrize("field", ["t", "timestamp", "offset_time", "time_stamp"])
def test_time_fields_by_their_usual_names(field: str) -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (field, "<u4")])
    stored = np.zeros(3, dtype)
    stored[field] = [1, 2, 4_000_000_000]
    scan = decode_cloud(cloud_message(STORE, 0, stored), 0, 0)
    assert scan.times.tolist() == [1, 2, 4_000_000_000]
    assert scan.ring is None
    assert scan.intensity is None


def test_named_time_field_wins_and_must_exist() -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("t", "<u4"), ("clock", "<u4")])
    stored = np.zeros(1, dtype)
    stored["clock"] = 9
    message = cloud_message(STORE, 0, stored)
    assert decode_cloud(message, 0, 0, "clock").times.tolist() == [9]
    with pytest.raises(DataError, match=r"no time field 'when'; it holds x, y, z, t, clock"):
        decode_cloud(message, 0, 0, "when")


def test_cloud_without_times_says_so_by_none() -> None:
    stored = np.zeros(2, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
    assert decode_cloud(cloud_message(STORE, 0, stored), 0, 0).times is None


def test_nan_points_are_kept_for_the_host_to_count() -> None:
    points = velodyne_points(8)
    points["x"][3] = np.nan
    assert np.isnan(decode_cloud(cloud_message(STORE, 0, points), 0, 0).xyz[3, 0])


def test_missing_axis_lists_the_fields() -> None:
    stored = np.zeros(1, np.dtype([("x", "<f4"), ("z", "<f4")]))
    with pytest.raises(DataError, match="no field y; it holds x, z"):
        decode_cloud(cloud_message(STORE, 0, stored), 0, 0)


def test_too_little_data_is_refused() -> None:
    message = cloud_message(STORE, 0, velodyne_points(8))
    message.data = message.data[:-1]
    with pytest.raises(DataError, match="claims 1 x 8 points"):
        decode_cloud(message, 0, 0)


def test_field_beyond_the_point_is_refused() -> None:
    message = cloud_message(STORE, 0, velodyne_points(8))
    message.fields[5].offset = 20
    with pytest.raises(DataError, match="'time' reaches beyond point_step"):
        decode_cloud(message, 0, 0)


def test_empty_cloud_is_an_empty_scan() -> None:
    assert len(decode_cloud(cloud_message(STORE, 0, velodyne_points(0)), 0, 0)) == 0
