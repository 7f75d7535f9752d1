# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A dense street: façades, parked and moving cars, poles, people."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.scenes.props import Road, car, moving_car, pedestrian, pole, tree
from d2lio.simulator.trajectory import drive
from d2lio.simulator.world import Body, Mover, World

SPEED = 6.0  # m/s
RAMP = 5.0  # s from standstill to cruise speed
VIEW = 100.0  # m of street beyond both ends of the drive
CURB, FRONT = 6.2, 9.0  # m from the middle of the street to the curb, to the façades
LANE = -1.8  # m, own lane (right-hand traffic)
FLOOR = 3.2  # m


def build(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """The street winds a little; one façade in ten is missing."""
    road = Road(5.0, 170.0, scene.uniform(0.0, 2.0 * np.pi))
    start, end = -VIEW, SPEED * duration + VIEW
    s = np.arange(start, end, 2.0)
    mesh = Mesh()
    road.strip(mesh, [(CURB, 0.0), (-CURB, 0.0)], s, "asphalt")
    for side in (-1.0, 1.0):
        walk = [(side * CURB, 0.0), (side * CURB, 0.14), (side * (FRONT + 25.0), 0.2)]
        road.strip(mesh, walk, s, "concrete")
        _facades(mesh, road, side, start, end, scene)
        _furniture(mesh, road, side, start, end, scene)
    movers = _traffic(road, duration, scene)

    def path(along: np.ndarray) -> np.ndarray:
        return road.at(along, LANE, 1.8)

    return World(Body(mesh), drive(path, SPEED, duration, motion, ramp=RAMP), tuple(movers))


def _facades(
    mesh: Mesh, road: Road, side: float, start: float, end: float, rng: np.random.Generator
) -> None:
    s = start
    while s < end:
        width = rng.uniform(8.0, 20.0)
        if rng.random() < 0.1:
            s += 0.5 * width
            continue
        setback = rng.uniform(0.0, 0.8)
        floors = int(rng.integers(2, 6))
        _building(mesh, road, side, s + width / 2, width, setback, floors, rng)
        s += width


def _building(
    mesh: Mesh,
    road: Road,
    side: float,
    s: float,
    width: float,
    setback: float,
    floors: int,
    rng: np.random.Generator,
) -> None:
    depth, height = 12.0, floors * FLOOR + 1.0
    middle, yaw = road.point(s, side * (FRONT + setback + depth / 2), height / 2 - 0.1)
    mesh.box(tuple(middle), (width, depth, height), str(rng.choice(["brick", "plaster"])), yaw)
    count = int(width / 2.8)
    relief = rng.uniform(0.08, 0.3)  # sills and frames; some houses have bays
    for floor in range(floors):
        for column in range(count):
            along = (column + 0.5) / count * width - width / 2
            up = 0.2 + floor * FLOOR + 1.7
            spot = np.array([along, -side * (depth / 2)])
            x = middle[0] + np.cos(yaw) * spot[0] - np.sin(yaw) * spot[1]
            y = middle[1] + np.sin(yaw) * spot[0] + np.cos(yaw) * spot[1]
            if floor == 0 and rng.random() < 0.3:  # shop front or porch
                mesh.box((x, y, 1.5), (2.2, 4.0 * relief, 2.8), "wood", yaw)
            else:
                mesh.box((x, y, up - 0.75), (1.4, 2.0 * relief, 0.12), "concrete", yaw)
                mesh.box((x, y, up), (1.1, 0.06, 1.4), "glass", yaw)


def _furniture(
    mesh: Mesh, road: Road, side: float, start: float, end: float, rng: np.random.Generator
) -> None:
    s = start
    while s < end:  # parked cars
        if rng.random() < 0.7:
            foot, yaw = road.point(s, side * (CURB - 1.1 + rng.normal(0.0, 0.08)))
            car(mesh, foot, yaw + rng.normal(0.0, 0.02), rng)
        s += 5.6 + rng.uniform(0.0, 1.0)
    for s in np.arange(start, end, 24.0):
        foot, _ = road.point(s + rng.uniform(-4.0, 4.0), side * (CURB + 0.5), 0.1)
        pole(mesh, foot, 7.0)
    for s in np.arange(start + 10.0, end, 40.0):
        if rng.random() < 0.5:
            foot, _ = road.point(s + rng.uniform(-5.0, 5.0), side * (CURB + 1.2), 0.1)
            tree(mesh, foot, rng, 350)


def _traffic(road: Road, duration: float, rng: np.random.Generator) -> list[Mover]:
    movers = [moving_car(road, 14.0, LANE, SPEED * rng.uniform(0.98, 1.05), duration, rng, RAMP)]
    gap = 20.0
    while gap < 2.0 * SPEED * duration:
        speed = -SPEED * rng.uniform(0.8, 1.4)
        movers.append(moving_car(road, gap, -LANE, speed, duration, rng))
        gap += rng.uniform(25.0, 60.0)
    for _ in range(6):
        side = rng.choice([-1.0, 1.0])
        start, speed = rng.uniform(5.0, SPEED * duration), rng.choice([-1.3, 1.3])
        movers.append(pedestrian(road, start, side * rng.uniform(7.0, 8.4), speed, duration))
    return movers
