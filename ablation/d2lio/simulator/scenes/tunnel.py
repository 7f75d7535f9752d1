# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Road tunnels: a smooth tube, bare or with a few cabinets on its wall."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.trajectory import drive
from d2lio.simulator.world import Body, World

RADIUS = 3.2  # m
AXIS_HEIGHT = 1.5  # m above the road
SPEED = 1.42  # m/s: 60 m in the 47 s of the default duration
REACH = 140.0  # m of tube beyond both ends of the drive: farther than a grazing ray returns
SENSOR_HEIGHT = 1.2  # m
CABINET_SPACING = (11.0, 19.0)  # m
CABINET_MARGIN = 25.0  # m of tunnel with cabinets beyond both ends of the drive


def bare(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """A straight tube with a flat road: nothing tells one metre from the next."""
    return _world(_tube(duration), motion, duration)


def cabinets(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """The same tube with a few cabinets standing against the wall."""
    mesh = _tube(duration)
    x = -CABINET_MARGIN + scene.uniform(0.0, CABINET_SPACING[0])
    while x < SPEED * duration + CABINET_MARGIN:
        _cabinet(mesh, x, scene)
        x += scene.uniform(*CABINET_SPACING)
    return _world(mesh, motion, duration)


def _tube(duration: float) -> Mesh:
    mesh = Mesh()
    foot = np.arcsin(AXIS_HEIGHT / RADIUS)
    angle = np.linspace(-foot, np.pi + foot, 97)
    vault = np.column_stack([RADIUS * np.cos(angle), AXIS_HEIGHT + RADIUS * np.sin(angle)])
    x = np.linspace(-REACH, SPEED * duration + REACH, 30)
    path = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    mesh.extrude(vault, path, np.zeros_like(x), "concrete")
    mesh.extrude(vault[[0, -1]], path, np.zeros_like(x), "asphalt")
    return mesh


def _cabinet(mesh: Mesh, x: float, rng: np.random.Generator) -> None:
    side = rng.choice([-1.0, 1.0])
    width, depth, height = rng.uniform(0.6, 1.2), rng.uniform(0.3, 0.5), rng.uniform(1.0, 1.8)
    wall = np.sqrt(RADIUS**2 - AXIS_HEIGHT**2)  # half width of the road, where the wall begins
    middle = (x, side * (wall - 0.5 * depth + 0.05), 0.5 * height - 0.01)
    mesh.box(middle, (width, depth, height), "metal")


def _world(mesh: Mesh, motion: np.random.Generator, duration: float) -> World:
    phase, lateral = motion.uniform(0.0, 2.0 * np.pi), motion.uniform(-0.4, 0.4)

    def path(s: np.ndarray) -> np.ndarray:
        weave = lateral + 0.15 * np.sin(2.0 * np.pi * s / 23.0 + phase)
        return np.column_stack([s, weave, np.full_like(s, SENSOR_HEIGHT)])

    return World(Body(mesh), drive(path, SPEED, duration, motion, ramp=4.0))
