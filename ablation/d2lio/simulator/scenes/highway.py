# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A highway and a bridge: long, repetitive, driven fast."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.scenes.props import Road, moving_car, pole, tree
from d2lio.simulator.trajectory import Ride, drive
from d2lio.simulator.world import Body, Mover, World

HIGHWAY_SPEED = 23.0  # m/s
BRIDGE_SPEED = 10.0  # m/s
VIEW = 125.0  # m beyond both ends of the drive
CAR_RIDE = Ride(0.01, 0.01, 0.006, 0.006, 0.003, (0.4, 1.8), 0.0004, 0.0004, (4.0, 7.5))
RAIL_PROFILE = [(0.0, 0.45), (0.06, 0.52), (0.0, 0.6), (0.06, 0.68), (0.0, 0.76)]  # m, W-beam
DECK_HALF = 7.0  # m
WATER_BELOW = 18.0  # m


def highway(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """Two carriageways, guard rails, lamp posts, now and then a sign; traffic."""
    road = Road(25.0, 900.0, scene.uniform(0.0, 2.0 * np.pi))
    start, end = -VIEW, HIGHWAY_SPEED * duration + VIEW
    s = np.arange(start, end, 2.0)
    mesh = Mesh()
    road.strip(mesh, [(13.0, 0.0), (-13.0, 0.0)], s, "asphalt")
    for side in (-1.0, 1.0):
        verge = [(side * 13.0, 0.0), (side * 16.0, -0.5), (side * 45.0, -0.2), (side * 70.0, 0.5)]
        road.strip(mesh, verge, s, "grass")
        _guard_rail(mesh, road, side * 12.6, s)
        _guard_rail(mesh, road, side * 0.7, s)
    _posts_and_signs(mesh, road, start, end, scene)
    lane = -5.2

    def path(along: np.ndarray) -> np.ndarray:
        return road.at(along, lane, 1.9)

    trajectory = drive(path, HIGHWAY_SPEED, duration, motion, ramp=16.0, ride=CAR_RIDE)
    return World(Body(mesh), trajectory, tuple(_highway_traffic(road, duration, scene)))


def _guard_rail(mesh: Mesh, road: Road, left: float, s: np.ndarray) -> None:
    road.strip(mesh, np.array(RAIL_PROFILE) + np.array([left, 0.0]), s, "metal")
    for post in np.arange(s[0], s[-1], 4.0):
        foot, yaw = road.point(post, left - 0.05, 0.35)
        mesh.box(tuple(foot), (0.06, 0.1, 0.75), "metal", yaw)


def _posts_and_signs(
    mesh: Mesh, road: Road, start: float, end: float, rng: np.random.Generator
) -> None:
    for s in np.arange(start, end, 50.0):
        foot, _ = road.point(s + rng.uniform(-1.0, 1.0), 0.0)
        pole(mesh, foot, 10.0, 0.11)
    s = start + rng.uniform(60.0, 160.0)
    while s < end:
        spot, yaw = road.point(s, -14.2, 3.2)
        mesh.box(tuple(spot), (0.06, 1.6, 1.8), "sign", yaw)
        pole(mesh, spot - np.array([0.0, 0.0, 3.5]), 2.8)
        s += rng.uniform(150.0, 320.0)
    for _ in range(int((end - start) / 45.0)):
        left = rng.choice([-1.0, 1.0]) * rng.uniform(24.0, 65.0)
        foot, _ = road.point(rng.uniform(start, end), left, -0.3)
        tree(mesh, foot, rng, 350)


def _highway_traffic(road: Road, duration: float, rng: np.random.Generator) -> list[Mover]:
    movers = []
    for lane in (-9.0, -2.9):  # slower on the right, faster on the left
        pace = 0.85 if lane < -5.0 else 1.1
        for start in (-380.0, -280.0, -190.0, -100.0, 0.0, 110.0):
            speed = HIGHWAY_SPEED * pace * rng.uniform(0.97, 1.03)
            place = start + rng.uniform(-25.0, 25.0)
            movers.append(moving_car(road, place, lane, speed, duration, rng))
    gap = 60.0
    while gap < 2.0 * HIGHWAY_SPEED * duration:
        speed = -HIGHWAY_SPEED * rng.uniform(0.9, 1.15)
        lane = float(rng.choice([3.0, 6.0, 9.0]))
        movers.append(moving_car(road, gap, lane, speed, duration, rng))
        gap += rng.uniform(60.0, 160.0)
    return movers


def bridge(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """A long suspension bridge: deck, railings, hangers; the water is out of reach below."""
    road = Road(0.0, 1000.0)
    start, end = -VIEW, BRIDGE_SPEED * duration + VIEW
    s = np.arange(start, end, 5.0)
    mesh = Mesh()
    deck = [(DECK_HALF, 0.2), (5.6, 0.2), (5.6, 0.0), (-5.6, 0.0), (-5.6, 0.2), (-DECK_HALF, 0.2)]
    road.strip(mesh, deck, s, "asphalt")
    water = [(150.0, -WATER_BELOW), (-150.0, -WATER_BELOW)]
    road.strip(mesh, water, s, "water")
    for side in (-1.0, 1.0):
        left = side * (DECK_HALF - 0.1)
        for up in (0.55, 0.85, 1.25):
            ends = road.at(np.array([start, end]), left, up)
            mesh.cylinder(ends[0], ends[1], 0.04, "metal", 8)
        for post in np.arange(start, end, 2.5):
            foot, _ = road.point(post, left, 0.1)
            mesh.box((foot[0], foot[1], 0.7), (0.07, 0.07, 1.2), "metal")
        _cables(mesh, side * (DECK_HALF - 0.5), start, end)
    for lamp in np.arange(start, end, 40.0):
        foot, _ = road.point(lamp, scene.choice([-1.0, 1.0]) * 5.9, 0.1)
        pole(mesh, foot, 8.0, 0.09)
    movers = [
        moving_car(road, gap, 2.0, -BRIDGE_SPEED * scene.uniform(0.8, 1.4), duration, scene)
        for gap in np.arange(60.0, 2.0 * BRIDGE_SPEED * duration, 130.0)
    ]

    def path(along: np.ndarray) -> np.ndarray:
        return road.at(along, -2.0, 1.8)

    trajectory = drive(path, BRIDGE_SPEED, duration, motion, ramp=8.0, ride=CAR_RIDE)
    return World(Body(mesh), trajectory, tuple(movers))


def _cables(mesh: Mesh, left: float, start: float, end: float) -> None:
    """Main cable between pylons 240 m apart, a hanger every 12 m."""
    span, pylon = 240.0, 28.0
    for x in np.arange(start + 12.0, end, 12.0):
        phase = (x - start) % span / span
        height = 4.0 + (pylon - 4.0) * (2.0 * phase - 1.0) ** 2
        mesh.cylinder(np.array([x, left, 0.1]), np.array([x, left, height]), 0.05, "metal", 8)
    for x in np.arange(start, end, span):
        mesh.box((x, left, pylon / 2 - 10.0), (1.6, 0.9, pylon + 20.0), "concrete")
        mesh.box((x, 0.0, 12.0), (1.2, 2.0 * abs(left), 1.2), "concrete")
