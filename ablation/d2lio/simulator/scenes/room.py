# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A furnished room, walked through with the sensor in the hand."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.trajectory import handheld
from d2lio.simulator.world import Body, World

# No multiple of the usual voxel sizes: of every voxel the map keeps the point nearest to its
# centre, which pulls a noisy surface towards the centre. Floor and ceiling a whole number of 0.5 m
# voxels apart are pulled the same way, and the estimate drifts by centimetres; no real room is
# that exact.
SIZE = (11.3, 9.2, 2.7)  # m
LOOP = (2.6, 1.9)  # m, half axes of the walk
LOOP_RATE = 0.45  # rad/s
HAND_HEIGHT = 1.45  # m


def build(scene: np.random.Generator, motion: np.random.Generator, duration: float) -> World:
    """Walls, tables, shelves and boxes; the walk circles the middle of the room."""
    mesh = Mesh()
    _shell(mesh, scene)
    _along_walls(mesh, scene)
    for x, y in ((-0.6, 0.0), (0.9, 0.2)):
        _table(mesh, x + scene.uniform(-0.2, 0.2), y + scene.uniform(-0.2, 0.2), scene)
    _chairs(mesh, scene)
    mesh.cylinder([3.9, 2.9, 0.0], [3.9, 2.9, SIZE[2]], 0.18, "plaster", 16)
    mesh.box((0.0, 0.0, SIZE[2] - 0.25), (1.4, 0.25, 0.12), "paint", scene.uniform(0.0, 3.0))
    start = motion.uniform(0.0, 2.0 * np.pi)

    def loop(phase: np.ndarray) -> np.ndarray:
        angle = phase + start
        wave = 1.0 + 0.08 * np.sin(3.0 * angle)
        return np.column_stack(
            [
                LOOP[0] * wave * np.cos(angle),
                LOOP[1] * wave * np.sin(angle),
                HAND_HEIGHT + 0.1 * np.sin(2.0 * angle),
            ]
        )

    return World(Body(mesh), handheld(loop, LOOP_RATE, duration, motion))


def _shell(mesh: Mesh, rng: np.random.Generator) -> None:
    width, depth, height = SIZE
    for material, z in (("wood", -0.05), ("plaster", height + 0.05)):
        mesh.box((0.0, 0.0, z), (width + 0.4, depth + 0.4, 0.1), material)
    for side in (-1.0, 1.0):
        mesh.box((side * (width / 2 + 0.1), 0.0, height / 2), (0.2, depth, height), "plaster")
        mesh.box((0.0, side * (depth / 2 + 0.1), height / 2), (width, 0.2, height), "plaster")
    # Door leaf, window frames and radiators stand out from the walls.
    mesh.box((-width / 2 + 0.03, rng.uniform(-2.5, 2.5), 1.02), (0.06, 0.95, 2.05), "wood")
    for x in (-3.0, 0.5, 3.6):
        mesh.box((x, depth / 2 - 0.02, 1.7), (1.5, 0.04, 1.2), "glass")
        mesh.box((x, depth / 2 - 0.06, 1.06), (1.7, 0.12, 0.05), "paint")
        mesh.box((x, depth / 2 - 0.08, 0.45), (1.2, 0.1, 0.6), "paint")


def _along_walls(mesh: Mesh, rng: np.random.Generator) -> None:
    width, depth, _ = SIZE
    x = -width / 2 + 0.8
    while x < width / 2 - 1.2:  # shelves and cupboards on the wall opposite the windows
        w, d, h = rng.uniform(0.6, 1.2), rng.uniform(0.3, 0.6), rng.uniform(0.8, 2.2)
        mesh.box((x + w / 2, -depth / 2 + d / 2, h / 2), (w, d, h), "wood")
        x += w + rng.uniform(0.1, 0.8)
    y = -depth / 2 + 1.2
    while y < depth / 2 - 1.5:  # boxes and a sofa on the far side
        w, d, h = rng.uniform(0.5, 1.4), rng.uniform(0.4, 0.8), rng.uniform(0.4, 1.5)
        mesh.box((width / 2 - d / 2, y + w / 2, h / 2), (d, w, h), "wood", rng.uniform(-0.1, 0.1))
        y += w + rng.uniform(0.3, 1.0)
    for _ in range(5):  # pictures
        mesh.box(
            (-width / 2 + 0.02, rng.uniform(-3.5, 3.5), rng.uniform(1.4, 1.9)),
            (0.04, rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.7)),
            "paint",
        )


def _table(mesh: Mesh, x: float, y: float, rng: np.random.Generator) -> None:
    yaw = rng.uniform(-0.3, 0.3)
    mesh.box((x, y, 0.73), (1.3, 0.75, 0.04), "wood", yaw)
    for dx in (-0.55, 0.55):
        for dy in (-0.3, 0.3):
            lx = x + dx * np.cos(yaw) - dy * np.sin(yaw)
            ly = y + dx * np.sin(yaw) + dy * np.cos(yaw)
            mesh.cylinder([lx, ly, 0.0], [lx, ly, 0.72], 0.025, "metal", 8)
    mesh.box((x + rng.uniform(-0.3, 0.3), y, 0.95), (0.5, 0.05, 0.35), "rubber", rng.uniform(-1, 1))


def _chairs(mesh: Mesh, rng: np.random.Generator) -> None:
    for _ in range(5):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        x, y, yaw = 1.5 * np.cos(angle), 1.1 * np.sin(angle), rng.uniform(0.0, np.pi)
        mesh.box((x, y, 0.45), (0.42, 0.42, 0.05), "wood", yaw)
        back = (x - 0.2 * np.cos(yaw), y - 0.2 * np.sin(yaw), 0.7)
        mesh.box(back, (0.04, 0.42, 0.45), "wood", yaw)
        mesh.cylinder([x, y, 0.0], [x, y, 0.44], 0.04, "metal", 8)
