# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Velodyne packets with known contents, written from the manuals' layout byte by byte."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from rosbags.typesys import get_types_from_msg

NS = 1_000_000_000
SPIN_DEG_PER_S = 3600.0  # 10 Hz

CHANNEL = np.dtype([("distance", "<u2"), ("reflectivity", "u1")])
BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("channels", CHANNEL, 32)])
DATA = np.dtype([("blocks", BLOCK, 12), ("clock_us", "<u4"), ("mode", "u1"), ("product", "u1")])
PACKET = np.dtype([("sec", "<u4"), ("nsec", "<u4"), ("data", DATA)])


@dataclass(frozen=True)
class Sensor:
    """Elevation in deg and firing time in ns of the 32 channels of a block."""

    product: int
    elevations: tuple[float, ...]
    offsets_ns: tuple[int, ...]
    block_ns: int


_VLP16_DEG = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)
VLP16 = Sensor(
    0x22,
    _VLP16_DEG * 2,
    tuple(2_304 * i for i in range(16)) + tuple(55_296 + 2_304 * i for i in range(16)),
    110_592,
)
# Laser 0 looks down by 30.67 deg, laser 1 by 9.33, then both in steps of 1.33 deg.
HDL32E = Sensor(
    0x21,
    tuple((-92 + 4 * (i // 2) + 64 * (i % 2)) / 3 for i in range(32)),
    tuple(1_152 * i for i in range(32)),
    46_080,
)


@dataclass(frozen=True)
class Sweep:
    """Returns [packets, 12, 32]: ranges in m on the 2 mm grid, 0 where there is none."""

    sensor: Sensor
    ranges: np.ndarray
    reflectivity: np.ndarray
    begin_deg: float

    def times_ns(self) -> np.ndarray:
        """From the first firing."""
        block = np.arange(len(self.ranges) * 12).reshape(-1, 12, 1) * self.sensor.block_ns
        return block + np.array(self.sensor.offsets_ns)

    def azimuth_deg(self) -> np.ndarray:
        """Blocks begin on the 0.01 deg grid, the channels follow at a constant rate."""
        step = self.step_units()
        block = np.arange(len(self.ranges) * 12).reshape(-1, 12, 1) * step
        inside = np.array(self.sensor.offsets_ns) / self.sensor.block_ns * step
        return self.begin_deg + 0.01 * (block + inside)

    def step_units(self) -> int:
        return round(SPIN_DEG_PER_S * self.sensor.block_ns * 1e-9 * 100)

    def xyz(self) -> np.ndarray:
        azimuth, height = np.deg2rad(self.azimuth_deg()), np.deg2rad(self.sensor.elevations)
        flat = self.ranges * np.cos(height)
        return np.stack(
            [flat * np.cos(azimuth), -flat * np.sin(azimuth), self.ranges * np.sin(height)], -1
        )

    def rings(self) -> np.ndarray:
        order = sorted(set(self.sensor.elevations))
        ring = [order.index(e) for e in self.sensor.elevations]
        return np.broadcast_to(ring, self.ranges.shape)


def sweep(
    sensor: Sensor, packets: int, seed: int, *, missing: float = 0.3, begin_deg: float = 90.0
) -> Sweep:
    """Random ranges between 1 and 100 m, a share of them missing."""
    rng = np.random.default_rng(seed)
    shape = (packets, 12, 32)
    ranges = 0.002 * rng.integers(500, 50_000, shape)
    ranges[rng.random(shape) < missing] = 0.0
    return Sweep(sensor, ranges, rng.integers(0, 256, shape), begin_deg)


def encode_packets(sensor: Sensor, known: Sweep, stamp: int, *, dual: bool = False) -> np.ndarray:
    """Packets of dtype PACKET; dual: the first six blocks of each, twice, nearer ones first."""
    out = np.zeros(len(known.ranges), PACKET)
    begin = stamp + known.times_ns()[:, 0, 0]
    out["sec"], out["nsec"] = begin // NS, begin % NS
    out["data"]["mode"], out["data"]["product"] = 0x37, sensor.product
    index = np.arange(12) // 2 if dual else np.arange(12)
    blocks = out["data"]["blocks"]
    blocks["flag"] = 0xEEFF
    blocks["azimuth"] = np.round(known.azimuth_deg()[:, index, 0] * 100).astype(int) % 36_000
    blocks["channels"]["distance"] = np.round(known.ranges[:, index] / 0.002).astype(int)
    blocks["channels"]["reflectivity"] = known.reflectivity[:, index]
    if dual:
        out["data"]["mode"] = 0x39
        blocks["channels"]["distance"][:, 0::2] //= 2
    out["data"]["blocks"] = blocks
    return out


def scan_bytes(
    stamp: int,
    packets: np.ndarray,
    *,
    cdr: bool = False,
    sizes: tuple[int, ...] | None = None,
    frame: bytes = b"velodyne",
) -> bytes:
    """A serialised VelodyneScan; `sizes` writes the packets as uint8[] of these lengths."""
    sec, nsec, count = stamp // NS, stamp % NS, len(packets)
    if cdr:
        head = struct.pack("<iII", sec, nsec, len(frame) + 1) + frame + b"\0"
        head += b"\0" * (-len(head) % 4) + struct.pack("<I", count)
        return b"\0\1\0\0" + head + b"\0\0".join(p.tobytes() for p in packets)
    head = struct.pack("<4I", 0, sec, nsec, len(frame)) + frame + struct.pack("<I", count)
    if sizes is None:
        return head + packets.tobytes()
    bodies = (
        p.tobytes()[:8] + struct.pack("<I", size) + p.tobytes()[8 : 8 + size]
        for p, size in zip(packets, sizes, strict=True)
    )
    return head + b"".join(bodies)


SCAN_TYPE = "velodyne_msgs/msg/VelodyneScan"
PACKET_TYPE = "velodyne_msgs/msg/VelodynePacket"


def register(store):
    """The store with the two message types of velodyne_msgs."""
    types = get_types_from_msg("time stamp\nuint8[1206] data\n", PACKET_TYPE)
    scan = "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n"
    types.update(get_types_from_msg(scan, SCAN_TYPE))
    store.register(types)
    return store


def scan_message(store, stamp: int, packets: np.ndarray):
    """The message as a ROS node would publish it."""
    time = store.types["builtin_interfaces/msg/Time"]
    head = store.types["std_msgs/msg/Header"](0, time(stamp // NS, stamp % NS), "velodyne")
    packet = store.types[PACKET_TYPE]
    bodies = [
        packet(time(int(p["sec"]), int(p["nsec"])), np.frombuffer(p["data"].tobytes(), np.uint8))
        for p in packets
    ]
    return store.types[SCAN_TYPE](head, bodies)
