# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Bags in the exact layouts of GEODE, SubT-MRS and ECMD, two seconds long."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bags import (
    CLOUD,
    IMU,
    NS,
    START,
    VELODYNE,
    Recorded,
    cloud_message,
    header,
    imu_message,
    ros1_store,
    write_bag,
)
from packets import SCAN_TYPE, VLP16, encode_packets, register, scan_message, sweep

SCANS = 20
CUSTOM = "livox_ros_driver/msg/CustomMsg"
OUSTER = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "reflectivity", "ring", "ambient", "range"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2", "u1", "<u2", "<u4"],
        "offsets": [0, 4, 8, 16, 20, 24, 26, 28, 32],
        "itemsize": 48,
    }
)


def imu_stream(
    topic: str, rate_hz: int, *, gravity: float = 9.81, begin: int = START, shift: int = 0
) -> list[Recorded]:
    """Samples at rest over the scans; `shift` is the recorder's clock minus the headers', ns."""
    store = ros1_store()
    stamps = begin - NS // 5 + np.arange(SCANS // 10 * rate_hz + rate_hz // 2) * (NS // rate_hz)
    return [
        Recorded(s + shift, topic, IMU, imu_message(store, s, accel=(0.0, 0.0, gravity)))
        for s in stamps.tolist()
    ]


def directions(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 10.0, (count, 3))


def vlp16_cloud(seed: int, *, nan_share: float = 0.4, begin: float = -0.101) -> np.ndarray:
    """GEODE alpha: 16 channels by column, times over 0.1023 s, many NaN."""
    count = 16 * 120
    points = np.zeros(count, VELODYNE)
    for axis, values in zip("xyz", directions(count, seed).T, strict=True):
        points[axis] = values
    bad = np.random.default_rng(seed + 99).random(count) < nan_share
    for axis in "xyz":
        points[axis][bad] = np.nan
    points["ring"] = np.arange(count) % 16
    points["time"] = np.linspace(begin, begin + 0.1023, count)
    return points


def ouster_cloud(seed: int) -> np.ndarray:
    """GEODE beta: t in ns from the scan's start."""
    count = 64 * 32
    points = np.zeros(count, OUSTER)
    for axis, values in zip("xyz", directions(count, seed).T, strict=True):
        points[axis] = values
    points["ring"] = np.arange(count) % 64
    points["t"] = np.repeat(np.linspace(0, 99_902_000, 32).astype(np.uint32), 64)
    return points


def custom_message(store, stamp: int, seed: int):
    point = store.types["livox_ros_driver/msg/CustomPoint"]
    xyz = directions(240, seed)
    offsets = np.linspace(0, 99_900_000, 240).astype(int)
    points = [
        point(int(t), *map(float, p), 40, 16, i % 6)
        for i, (t, p) in enumerate(zip(offsets, xyz, strict=True))
    ]
    head = header(store, stamp, "livox_frame")
    return store.types[CUSTOM](head, stamp, len(points), 0, np.zeros(3, np.uint8), points)


def write_known(path: Path, kind: str, messages: list[Recorded] | None = None) -> Path:
    """The bag of a device: alpha, beta, gamma, rc2 or ecmd; `messages` adds to it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = {"alpha": _alpha, "beta": _beta, "gamma": _gamma, "rc2": _rc2, "ecmd": _ecmd}[kind]()
    everything = sorted(made + (messages or []), key=lambda m: m.log)
    return write_bag(path, everything, register(ros1_store()))


def _scan_stamps() -> list[int]:
    return [START + i * NS // 10 for i in range(SCANS)]


def _alpha() -> list[Recorded]:
    store = ros1_store()
    return imu_stream("/imu/data", 100) + [
        Recorded(s, "/velodyne_points", CLOUD, cloud_message(store, s, vlp16_cloud(i)))
        for i, s in enumerate(_scan_stamps())
    ]


def _beta() -> list[Recorded]:
    store = ros1_store()
    return imu_stream("/imu/data", 100) + [
        Recorded(s + NS // 10, "/ouster/points", CLOUD, cloud_message(store, s, ouster_cloud(i)))
        for i, s in enumerate(_scan_stamps())
    ]


def _gamma() -> list[Recorded]:
    store = ros1_store()
    own = imu_stream("/livox/imu", 200, gravity=1.0)
    return (
        imu_stream("/imu/data", 100)
        + own
        + [
            Recorded(s + NS // 10, "/livox/lidar", CUSTOM, custom_message(store, s, i))
            for i, s in enumerate(_scan_stamps())
        ]
    )


def _rc2() -> list[Recorded]:
    store = register(ros1_store())
    begin, shift = 1_517_157_100 * NS, 173_097_000 * NS
    scans = []
    for index in range(SCANS):
        stamp = begin + index * 100_908_174  # 9.91 Hz
        packets = encode_packets(VLP16, sweep(VLP16, packets=76, seed=index), stamp)
        message = scan_message(store, stamp, packets)
        scans.append(Recorded(stamp + NS // 10 + shift, "/velodyne_packets", SCAN_TYPE, message))
    return imu_stream("/imu/data", 200, begin=begin, shift=shift) + scans


def _ecmd() -> list[Recorded]:
    store = ros1_store()
    scans = []
    for index, stamp in enumerate(_scan_stamps()):
        points = vlp16_cloud(index, nan_share=0.0, begin=0.0)
        points["ring"] = np.arange(len(points)) % 32
        message = cloud_message(store, stamp, points)
        scans.append(Recorded(stamp + NS // 10, "/velodyne_points", CLOUD, message))
    return imu_stream("/imu/data", 400) + scans
