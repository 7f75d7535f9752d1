# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Simulated points lie on the scene's surfaces, de-skewed with the true trajectory."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from d2lio.simulator.lidar import SENSORS
from d2lio.simulator.pipeline import LEAD_NS, extrinsic, take_scan
from d2lio.simulator.scenes import SCENES
from d2lio.simulator.world import World

ON_SURFACE = 1e-4  # m; limited by float32 coordinates of the message at up to 100 m
SKEWED = 0.02  # m; what ignoring the motion must cost for the test to mean anything
MOVING_AT = 4.0  # s, past the standstill
CHECKED = 60  # points per scan


def static_scene(name: str) -> World:
    world = SCENES[name].build(np.random.default_rng(1), np.random.default_rng(2), 6.0)
    return World(world.fixed, world.trajectory)


def moving_scan(world: World, sensor: str, sigma: float = 0.0):
    first = int((MOVING_AT * 1e9 - LEAD_NS) // 100_000_000)
    return take_scan(world, SENSORS[sensor], first, sigma, np.random.default_rng(3))


def to_world(world: World, scan, t: np.ndarray) -> np.ndarray:
    points = np.column_stack([scan.points[axis] for axis in "xyz"]).astype(float)
    mount = extrinsic()
    body = points @ mount[:3, :3].T + mount[:3, 3]
    position, rotation = world.trajectory.pose(t)
    return np.einsum("nij,nj->ni", rotation, body) + position


def distance_to_mesh(world: World, points: np.ndarray) -> np.ndarray:
    """Brute force over all triangles: shares no code with the ray caster."""
    corners = world.fixed.corners + world.fixed.center
    distance = []
    for point in points:
        near = trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1)))
        distance.append(np.linalg.norm(near - point, axis=1).min())
    return np.array(distance)


@pytest.mark.parametrize(
    ("scene", "sensor"), [("room", "vlp16"), ("room", "avia"), ("tunnel_cabinets", "os1_64")]
)
def test_points_lie_on_the_mesh_when_deskewed_with_the_truth(scene: str, sensor: str) -> None:
    world = static_scene(scene)
    scan = moving_scan(world, sensor)
    t = scan.start * 1e-9 + scan.points["time"].astype(float)
    pick = np.random.default_rng(4).choice(len(t), CHECKED, replace=False)
    deskewed = to_world(world, scan, t)[pick]
    skewed = to_world(world, scan, np.full_like(t, scan.start * 1e-9))[pick]
    assert distance_to_mesh(world, deskewed).max() < ON_SURFACE
    assert distance_to_mesh(world, skewed).max() > SKEWED


def test_range_noise_has_the_asked_for_deviation() -> None:
    world = static_scene("room")
    clean, noisy = moving_scan(world, "vlp16"), moving_scan(world, "vlp16", sigma=0.02)
    ranges = [
        np.sqrt(sum(scan.points[axis].astype(float) ** 2 for axis in "xyz"))
        for scan in (clean, noisy)
    ]
    np.testing.assert_array_equal(clean.points["time"], noisy.points["time"])
    error = ranges[1] - ranges[0]
    assert abs(error.mean()) < 5e-4
    assert error.std() == pytest.approx(0.02, rel=0.03)


def test_bare_tunnel_is_the_same_all_along() -> None:
    world = static_scene("tunnel")
    direction = np.random.default_rng(5).normal(size=(500, 3))
    direction[:, 0] *= 0.2  # keep the hits near
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    there, here = (
        world.fixed.cast(np.tile([x, 0.0, 1.2], (500, 1)), direction).distance for x in (0.0, 7.3)
    )
    np.testing.assert_allclose(there, here, atol=1e-9)
