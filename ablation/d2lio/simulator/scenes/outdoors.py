# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Open country: off-road drive, waterway, flat ground."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.scenes.props import Road, Terrain, bush, ground, pole, tree
from d2lio.simulator.trajectory import Ride, drive
from d2lio.simulator.world import Body, World

OFFROAD_SPEED = 3.0  # m/s
OFFROAD_VIEW = 70.0  # m of terrain around the drive
OFFROAD_RIDE = Ride(0.012, 0.008, 0.015, 0.015, 0.006, (0.5, 2.0), 0.0008, 0.001, (4.0, 7.5))
TREE_AREA, BUSH_AREA = 170.0, 90.0  # m² of ground per tree, per bush
TRACK = 4.0  # m kept free on both sides of the wheels

BOAT_SPEED = 3.0
BOAT_RIDE = Ride(0.03, 0.03, 0.025, 0.012, 0.01, (0.12, 0.5), 0.0003, 0.0004, (5.0, 7.5))
CANAL_HALF_WIDTH = 12.0
CANAL_VIEW = 90.0

FLAT_SPEED = 4.0
FLAT_VIEW = 110.0


def offroad(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """Rolling ground with trees and bushes, crossed by a rough vehicle."""
    terrain = Terrain(scene, 0.9, (7.0, 80.0))
    road = Road(6.0, 90.0, scene.uniform(0.0, 2.0 * np.pi))
    length = OFFROAD_SPEED * duration
    x = np.arange(-OFFROAD_VIEW, length + OFFROAD_VIEW, 0.6)
    y = np.arange(-OFFROAD_VIEW, OFFROAD_VIEW, 0.6)
    rough = terrain.height(x[:, None], y) + scene.normal(0.0, 0.02, (len(x), len(y)))
    mesh = Mesh()
    ground(mesh, x, y, rough, "grass")
    area = (x[-1] - x[0]) * (y[-1] - y[0])
    for plant, share in ((tree, TREE_AREA), (bush, BUSH_AREA)):
        for _ in range(int(area / share)):
            s, left = scene.uniform(x[0], x[-1]), scene.uniform(y[0] + 8.0, y[-1] - 8.0)
            if abs(left) < TRACK:
                continue
            foot, _ = road.point(s, left)
            foot[2] = terrain.height(foot[0], foot[1])
            plant(mesh, foot, scene)

    def path(s: np.ndarray) -> np.ndarray:
        point = road.at(s)
        wheels = [road.at(s + ds, left) for ds in (-1.1, 1.1) for left in (-0.8, 0.8)]
        point[:, 2] = 1.3 + np.mean([terrain.height(w[:, 0], w[:, 1]) for w in wheels], axis=0)
        return point

    def roll(s: np.ndarray) -> np.ndarray:
        left, right = road.at(s, 0.8), road.at(s, -0.8)
        rise = terrain.height(left[:, 0], left[:, 1]) - terrain.height(right[:, 0], right[:, 1])
        return np.arctan(rise / 1.6)

    trajectory = drive(path, OFFROAD_SPEED, duration, motion, ride=OFFROAD_RIDE, roll=roll)
    return World(Body(mesh), trajectory)


def waterway(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """A canal seen from a boat: water swallows most rays, the banks are grown over."""
    road = Road(8.0, 160.0, scene.uniform(0.0, 2.0 * np.pi))
    terrain = Terrain(scene, 0.35, (3.0, 30.0))
    length = BOAT_SPEED * duration
    s = np.arange(-CANAL_VIEW, length + CANAL_VIEW, 0.8)
    mesh = Mesh()
    half = CANAL_HALF_WIDTH
    road.strip(mesh, [(half + 2.0, 0.0), (-half - 2.0, 0.0)], s, "water")
    for side in (-1.0, 1.0):
        left = np.concatenate([np.arange(0.0, 8.0, 0.5), np.arange(8.0, 40.0, 1.5)])
        points = np.stack([road.at(s, side * (half + d)) for d in left], axis=1)
        rise = 2.0 * np.clip(left / 5.0, 0.0, 1.0) ** 1.2 - 0.3
        rough = terrain.height(points[..., 0], points[..., 1]) * np.clip(left / 3.0, 0.1, 1.0)
        points[..., 2] = rise + rough + scene.normal(0.0, 0.03, rough.shape)
        mesh.sheet(points, "grass")
        _bank_plants(mesh, road, side, s, scene)

    def path(along: np.ndarray) -> np.ndarray:
        return road.at(along, 1.5, 1.6)

    trajectory = drive(path, BOAT_SPEED, duration, motion, ramp=8.0, ride=BOAT_RIDE)
    return World(Body(mesh), trajectory)


def _bank_plants(
    mesh: Mesh, road: Road, side: float, s: np.ndarray, rng: np.random.Generator
) -> None:
    span = s[-1] - s[0]
    for plant, step, near, far, up in (
        (tree, 9.0, 5.0, 22.0, 1.8),
        (bush, 4.0, 1.5, 12.0, 0.7),
        (bush, 3.0, 0.3, 1.0, -0.2),  # reeds at the water's edge
    ):
        for _ in range(int(span / step)):
            distance = CANAL_HALF_WIDTH + rng.uniform(near, far)
            foot, _ = road.point(rng.uniform(s[0], s[-1]), side * distance, up)
            plant(mesh, foot, rng)


def flat_ground(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """An open field: nearly flat ground, a few poles and bushes far apart."""
    terrain = Terrain(scene, 0.02, (3.0, 25.0))
    road = Road(12.0, 140.0, scene.uniform(0.0, 2.0 * np.pi))
    length = FLAT_SPEED * duration
    x = np.arange(-FLAT_VIEW, length + FLAT_VIEW, 1.0)
    y = np.arange(-FLAT_VIEW, FLAT_VIEW, 1.0)
    mesh = Mesh()
    ground(mesh, x, y, terrain.height(x[:, None], y), "grass")
    for s in np.arange(-20.0, length + 40.0, 35.0):
        left = scene.choice([-1.0, 1.0]) * scene.uniform(12.0, 45.0)
        foot, _ = road.point(s + scene.uniform(-10.0, 10.0), left, -0.1)
        if scene.random() < 0.5:
            pole(mesh, foot, scene.uniform(2.0, 6.0), 0.1)
        else:
            bush(mesh, foot, scene)

    def path(s: np.ndarray) -> np.ndarray:
        return road.at(s, 0.0, 1.4)

    return World(Body(mesh), drive(path, FLAT_SPEED, duration, motion, ramp=4.0))
