# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Beam patterns of common lidars: when and where each ray of a scan is fired."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SCAN_NS = 100_000_000  # 10 Hz


@dataclass(frozen=True)
class Rays:
    """Rays of one scan in the driver's point order.

    t_ns (n,) int64 since the sensor was switched on, directions (n, 3) unit vectors in the
    lidar frame (x forward, z up), ring (n,) uint16.
    """

    t_ns: np.ndarray
    directions: np.ndarray
    ring: np.ndarray


@dataclass(frozen=True)
class Sensor:
    """A lidar model. Ranges in m; range_10 is where a 10 % target is seen half of the time."""

    description: str
    model: str
    rings: int
    min_range: float
    max_range: float
    range_10: float
    range_noise: float  # 1 σ, m
    resolution: float  # m, step of the reported range
    rays: Callable[[int], Rays]
    rate_hz: float = 10.0


def _unit(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Directions (n, 3); azimuth is counter-clockwise seen from above, both in rad."""
    flat = np.cos(elevation)
    return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def _spinning(scan: int, cycle_ns: int, laser_ns: int, elevations_deg: np.ndarray) -> Rays:
    """A Velodyne: lasers fire one after the other, cycles follow without regard to the scan."""
    first = -(-scan * SCAN_NS // cycle_ns)
    last = -(-(scan + 1) * SCAN_NS // cycle_ns)
    lasers = len(elevations_deg)
    t_ns = (
        np.arange(first, last, dtype=np.int64)[:, None] * cycle_ns
        + laser_ns * np.arange(lasers, dtype=np.int64)
    ).ravel()
    turn = (t_ns % SCAN_NS) / SCAN_NS
    elevation = np.tile(np.deg2rad(elevations_deg), last - first)
    ring_of_laser = np.argsort(np.argsort(elevations_deg)).astype(np.uint16)
    # Velodyne rotors turn clockwise; half a turn puts the cut between scans behind the sensor.
    return Rays(
        t_ns, _unit(np.pi - 2.0 * np.pi * turn, elevation), np.tile(ring_of_laser, last - first)
    )


VLP16_ELEVATIONS_DEG = np.array(
    [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15], dtype=float
)  # by laser, in firing order
HDL32E_ELEVATIONS_DEG = np.column_stack(
    [-92.0 / 3.0 + 4.0 / 3.0 * np.arange(16), -28.0 / 3.0 + 4.0 / 3.0 * np.arange(16)]
).ravel()  # by laser, in firing order
OS1_ELEVATIONS_DEG = np.linspace(16.6, -16.6, 64)  # by row, top row first
OS1_OFFSETS_DEG = np.tile([3.164, 1.055, -1.055, -3.164], 16)  # staggered columns of the gen 1
OS1_COLUMNS = 1024

AVIA_POINTS = 24_000
AVIA_LINES = 6
AVIA_RADIUS_DEG = 35.2  # half of the horizontal field of view
AVIA_LINE_SPREAD_DEG = 3.4  # the lines widen the vertical field to 77.2 deg
AVIA_PRISM_HZ = (7294.0 / 60.0, -4664.0 / 60.0)  # counter-rotating Risley prisms


def vlp16(scan: int) -> Rays:
    """Velodyne VLP-16: 16 lasers, 2.304 µs apart, every 55.296 µs."""
    return _spinning(scan, 55_296, 2_304, VLP16_ELEVATIONS_DEG)


def hdl32e(scan: int) -> Rays:
    """Velodyne HDL-32E: 32 lasers, 1.152 µs apart, every 46.08 µs."""
    return _spinning(scan, 46_080, 1_152, HDL32E_ELEVATIONS_DEG)


def os1_64(scan: int) -> Rays:
    """Ouster OS1-64, first generation: 1024 columns of 64 rays fired at once."""
    column = np.arange(OS1_COLUMNS)
    t_column = scan * SCAN_NS + column * SCAN_NS // OS1_COLUMNS
    azimuth = np.pi - 2.0 * np.pi * column[:, None] / OS1_COLUMNS + np.deg2rad(OS1_OFFSETS_DEG)
    elevation = np.tile(np.deg2rad(OS1_ELEVATIONS_DEG), OS1_COLUMNS)
    rows = len(OS1_ELEVATIONS_DEG)
    return Rays(
        np.repeat(t_column, rows).astype(np.int64),
        _unit(azimuth.ravel(), elevation),
        np.tile(np.arange(rows, dtype=np.uint16), OS1_COLUMNS),
    )


def avia(scan: int) -> Rays:
    """Livox Avia: six lines swept along a rosette that never repeats, 240 000 points/s.

    The rosette is that of two counter-rotating wedge prisms; the six lines are stacked upright.
    """
    index = np.arange(AVIA_POINTS)
    t_ns = (scan * SCAN_NS + index * SCAN_NS // AVIA_POINTS).astype(np.int64)
    seconds = t_ns * 1e-9
    line = index % AVIA_LINES
    half = np.deg2rad(AVIA_RADIUS_DEG) / 2.0
    first, second = (2.0 * np.pi * (rate * seconds % 1.0) for rate in AVIA_PRISM_HZ)
    horizontal = half * (np.cos(first) + np.cos(second))
    vertical = half * (np.sin(first) + np.sin(second))
    vertical += np.deg2rad(AVIA_LINE_SPREAD_DEG) * (2.0 * line / (AVIA_LINES - 1) - 1.0)
    return Rays(t_ns, _unit(horizontal, vertical), line.astype(np.uint16))


SENSORS: dict[str, Sensor] = {
    "vlp16": Sensor(
        "Velodyne VLP-16: 16 rings, 30 deg", "vlp16", 16, 0.5, 100.0, 50.0, 0.02, 0.002, vlp16
    ),
    "hdl32e": Sensor(
        "Velodyne HDL-32E: 32 rings, 41 deg", "hdl32e", 32, 0.9, 100.0, 60.0, 0.02, 0.002, hdl32e
    ),
    "os1_64": Sensor(
        "Ouster OS1-64 gen 1: 64 rings, 33 deg", "os1_64", 64, 0.5, 120.0, 55.0, 0.02, 0.001, os1_64
    ),
    "avia": Sensor(
        "Livox Avia: rosette, 70 x 77 deg forward", "avia", 6, 1.0, 190.0, 120.0, 0.02, 0.001, avia
    ),
}
