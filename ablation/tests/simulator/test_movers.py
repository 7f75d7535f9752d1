# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Moving bodies are seen where they are at each ray's own time."""

from __future__ import annotations

import numpy as np
from d2lio.simulator.lidar import SENSORS
from d2lio.simulator.mesh import MATERIAL_ID, Mesh
from d2lio.simulator.trajectory import Trajectory, time_grid
from d2lio.simulator.world import Body, Mover, World

SPEED = 20.0  # m/s
SIZE = (4.0, 2.0, 2.0)  # m
DURATION = 1.0
EXACT = 1e-5  # m


def straight(start: tuple[float, float, float], speed: float, yaw_rate: float) -> Trajectory:
    t = time_grid(DURATION)
    position = np.array(start) + np.outer(t, [0.0, speed, 0.0])
    angles = np.column_stack([yaw_rate * t, np.zeros_like(t), np.zeros_like(t)])
    return Trajectory(t, position, angles, DURATION)


def crossing_box() -> World:
    floor, box = Mesh(), Mesh()
    floor.box((0.0, 0.0, -3.0), (200.0, 200.0, 0.2), "asphalt")
    box.box((0.0, 0.0, 0.0), SIZE, "car")
    mover = Mover(Body(box), straight((15.0, -10.0, 0.0), SPEED, 0.8))
    return World(Body(floor), straight((0.0, 0.0, 0.0), 0.0, 0.0), (mover,))


def distance_to_box(points: np.ndarray) -> np.ndarray:
    beyond = np.abs(points) - 0.5 * np.array(SIZE)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0)


def test_hits_lie_on_the_moving_box_at_their_own_time() -> None:
    world = crossing_box()
    rays = SENSORS["vlp16"].rays(4)
    t = rays.t_ns * 1e-9
    origin = np.zeros_like(rays.directions)
    hits = world.cast(t, origin, rays.directions, 100.0)
    on_car = np.flatnonzero(hits.material == MATERIAL_ID["car"])
    assert len(on_car) > 200
    points = rays.directions[on_car] * hits.distance[on_car, None]
    path = world.movers[0].trajectory

    def in_box(moments: np.ndarray) -> np.ndarray:
        position, rotation = path.pose(moments)
        return np.einsum("nji,nj->ni", rotation, points - position)

    assert np.abs(distance_to_box(in_box(t[on_car]))).max() < EXACT
    frozen = np.full(len(on_car), t[0])
    assert np.abs(distance_to_box(in_box(frozen))).max() > 0.1


def test_a_mover_hides_what_is_behind_it_and_nothing_before_it() -> None:
    world = crossing_box()
    t = np.array([0.5, 0.5])
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    hits = world.cast(t, np.zeros((2, 3)), directions, 100.0)
    assert hits.material[0] == MATERIAL_ID["car"]
    assert abs(hits.distance[0] - (15.0 - 2.0 / np.cos(0.8 * 0.5))) < EXACT
    assert hits.material[1] == MATERIAL_ID["asphalt"]


def test_moving_bodies_do_not_change_with_the_trajectory_of_the_sensor() -> None:
    world = crossing_box()
    t = np.array([0.5])
    away = world.cast(t, np.array([[15.0, 0.0, 5.0]]), np.array([[0.0, 0.0, -1.0]]), 100.0)
    assert abs(away.distance[0] - 4.0) < EXACT
