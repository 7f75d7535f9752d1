# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Beam patterns: counts, angles, firing times, point order."""

from __future__ import annotations

import numpy as np
import pytest
from d2lio.simulator.lidar import SCAN_NS, SENSORS

NAMES = list(SENSORS)


def elevation_deg(directions: np.ndarray) -> np.ndarray:
    return np.rad2deg(np.arcsin(directions[:, 2]))


@pytest.mark.parametrize("name", NAMES)
def test_rays_are_unit_vectors_in_firing_order_within_the_scan(name: str) -> None:
    for scan in (0, 1, 123):
        rays = SENSORS[name].rays(scan)
        assert rays.t_ns.dtype == np.int64
        assert np.all(np.diff(rays.t_ns) >= 0)
        assert rays.t_ns[0] >= scan * SCAN_NS
        assert rays.t_ns[-1] < (scan + 1) * SCAN_NS + 50_000  # the last firing may run over
        assert rays.ring.max() == SENSORS[name].rings - 1
        np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("vlp16", {1808 * 16, 1809 * 16}),
        ("hdl32e", {2170 * 32, 2171 * 32}),
        ("os1_64", {1024 * 64}),
        ("avia", {24_000}),
    ],
)
def test_number_of_rays_per_scan(name: str, counts: set[int]) -> None:
    assert {len(SENSORS[name].rays(scan).t_ns) for scan in range(12)} == counts


@pytest.mark.parametrize(
    ("name", "low", "high", "bottom_up"),
    [
        ("vlp16", -15.0, 15.0, True),
        ("hdl32e", -30.667, 10.667, True),
        ("os1_64", -16.6, 16.6, False),
    ],
)
def test_rings_have_even_elevations(name: str, low: float, high: float, bottom_up: bool) -> None:
    rays = SENSORS[name].rays(7)
    elevation = elevation_deg(rays.directions)
    rings = SENSORS[name].rings
    by_ring = np.array([np.median(elevation[rays.ring == ring]) for ring in range(rings)])
    expected = np.linspace(low, high, rings)
    np.testing.assert_allclose(by_ring, expected if bottom_up else expected[::-1], atol=1e-3)


@pytest.mark.parametrize(
    ("name", "cycle_ns", "laser_ns"), [("vlp16", 55_296, 2_304), ("hdl32e", 46_080, 1_152)]
)
def test_velodyne_lasers_fire_one_by_one(name: str, cycle_ns: int, laser_ns: int) -> None:
    lasers = SENSORS[name].rings
    t = SENSORS[name].rays(3).t_ns.reshape(-1, lasers)
    assert np.all(np.diff(t, axis=1) == laser_ns)
    assert np.all(np.diff(t[:, 0]) == cycle_ns)
    following = SENSORS[name].rays(4).t_ns
    assert following[0] - t[-1, 0] == cycle_ns  # no gap and no overlap between scans


def test_vlp16_fires_up_and_down_in_turn_and_turns_clockwise() -> None:
    rays = SENSORS["vlp16"].rays(2)
    assert list(rays.ring[:6]) == [0, 8, 1, 9, 2, 10]
    azimuth = np.unwrap(np.arctan2(rays.directions[:, 1], rays.directions[:, 0]))
    assert np.all(np.diff(azimuth) < 0.0)
    assert azimuth[0] - azimuth[-1] == pytest.approx(2.0 * np.pi, rel=1e-3)


def test_ouster_fires_whole_columns() -> None:
    rays = SENSORS["os1_64"].rays(5)
    assert np.all(rays.t_ns.reshape(1024, 64) == rays.t_ns.reshape(1024, 64)[:, :1])
    assert list(rays.ring[:64]) == list(range(64))


def test_avia_fills_its_field_and_never_repeats() -> None:
    rays = SENSORS["avia"].rays(0)
    horizontal = np.rad2deg(np.arctan2(rays.directions[:, 1], rays.directions[:, 0]))
    assert np.ptp(horizontal) == pytest.approx(70.4, abs=0.5)
    assert np.ptp(elevation_deg(rays.directions)) == pytest.approx(77.2, abs=0.5)
    later = SENSORS["avia"].rays(1)
    assert np.abs(rays.directions - later.directions).max() > 0.1
