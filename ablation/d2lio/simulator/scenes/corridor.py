# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A long office corridor with few doors."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.trajectory import Ride, drive
from d2lio.simulator.world import Body, World

WIDTH, HEIGHT = 2.4, 2.7  # m
SPEED = 1.25  # m/s
REACH = 110.0  # m of corridor beyond both ends of the walk
DOOR_SPACING = (7.0, 16.0)  # m
SENSOR_HEIGHT = 1.1  # m
CART = Ride(0.003, 0.006, 0.008, 0.006, 0.012, (0.5, 1.8), 0.0004, 0.0006, (4.0, 7.5))


def build(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """Two plain walls, floor and ceiling; closed doors in thin frames, a few notice boards."""
    mesh = Mesh()
    length = SPEED * duration
    x = np.linspace(-REACH, length + REACH, 40)
    path = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    half = WIDTH / 2
    walls = {"wood": [(half, 0.0), (-half, 0.0)], "paint": [(half, HEIGHT), (-half, HEIGHT)]}
    for material, profile in walls.items():
        mesh.extrude(np.array(profile), path, np.zeros_like(x), material)
    for side in (-half, half):
        wall = np.array([(side, 0.0), (side, HEIGHT)])
        mesh.extrude(wall, path, np.zeros_like(x), "plaster")
    door = -20.0 + scene.uniform(0.0, DOOR_SPACING[0])
    while door < length + 20.0:
        _door(mesh, door, scene.choice([-1.0, 1.0]), scene)
        door += scene.uniform(*DOOR_SPACING)
    lateral, phase = motion.uniform(-0.2, 0.2), motion.uniform(0.0, 2.0 * np.pi)

    def walk(s: np.ndarray) -> np.ndarray:
        weave = lateral + 0.12 * np.sin(2.0 * np.pi * s / 11.0 + phase)
        return np.column_stack([s, weave, np.full_like(s, SENSOR_HEIGHT)])

    return World(Body(mesh), drive(walk, SPEED, duration, motion, ramp=2.0, ride=CART))


def _door(mesh: Mesh, x: float, side: float, rng: np.random.Generator) -> None:
    y = side * WIDTH / 2
    for dx in (-0.5, 0.5):
        mesh.box((x + dx, y, 1.05), (0.1, 0.1, 2.1), "wood")
    mesh.box((x, y, 2.13), (1.1, 0.1, 0.1), "wood")
    mesh.box((x, y, 1.04), (0.9, 0.03, 2.06), "wood")
    if rng.random() < 0.4:  # a notice board or an extinguisher box beside it
        depth = rng.uniform(0.03, 0.18)
        mesh.box((x + rng.uniform(1.2, 2.5), -y, 1.3), (0.5, 2.0 * depth, 0.6), "metal")
