# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Triangle meshes with a material per face, and the shapes the scenes are built from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Material:
    """Diffuse reflectivity in [0, 1] and the share of rays that come back at all."""

    reflectivity: float
    keep: float = 1.0


MATERIALS: dict[str, Material] = {
    "concrete": Material(0.35),
    "asphalt": Material(0.18),
    "plaster": Material(0.6),
    "metal": Material(0.5),
    "paint": Material(0.7),
    "wood": Material(0.4),
    "brick": Material(0.3),
    "glass": Material(0.25, 0.25),
    "car": Material(0.45, 0.95),
    "rubber": Material(0.08),
    "soil": Material(0.25),
    "grass": Material(0.4),
    "leaf": Material(0.45, 0.9),
    "water": Material(0.03, 0.02),
    "sign": Material(1.0),
}
MATERIAL_ID = {name: index for index, name in enumerate(MATERIALS)}
REFLECTIVITY = np.array([material.reflectivity for material in MATERIALS.values()])
KEEP = np.array([material.keep for material in MATERIALS.values()])


@dataclass
class Mesh:
    """A growing triangle mesh: corners (n, 3, 3) in m, material (n,) index."""

    _corners: list[np.ndarray] = field(default_factory=list)
    _material: list[np.ndarray] = field(default_factory=list)

    @property
    def corners(self) -> np.ndarray:
        """Triangle corners (n, 3, 3) float64."""
        return np.concatenate(self._corners) if self._corners else np.empty((0, 3, 3))

    @property
    def material(self) -> np.ndarray:
        """Material index (n,) of each triangle."""
        return np.concatenate(self._material) if self._material else np.empty(0, dtype=np.int64)

    def triangles(self, corners: np.ndarray, material: str) -> None:
        """Add triangles (n, 3, 3)."""
        corners = np.asarray(corners, dtype=float)
        self._corners.append(corners)
        self._material.append(np.full(len(corners), MATERIAL_ID[material], dtype=np.int64))

    def sheet(self, grid: np.ndarray, material: str) -> None:
        """Add a surface through a grid of points (rows, columns, 3)."""
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        first = np.stack([a, b, c], axis=2).reshape(-1, 3, 3)
        second = np.stack([a, c, d], axis=2).reshape(-1, 3, 3)
        self.triangles(np.concatenate([first, second]), material)

    def box(
        self,
        center: tuple[float, float, float],
        size: tuple[float, float, float],
        material: str,
        yaw: float = 0.0,
        taper: float = 1.0,
    ) -> None:
        """Add a box, turned by yaw (rad) about its upright axis, its top scaled by taper."""
        half = 0.5 * np.asarray(size, dtype=float)
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        points = signs * half
        points[signs[:, 2] > 0, :2] *= taper
        points = _turn(points, yaw) + np.asarray(center, dtype=float)
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
        self.triangles(points[faces], material)

    def cylinder(
        self, base: np.ndarray, top: np.ndarray, radius: float, material: str, sides: int = 12
    ) -> None:
        """Add a capped cylinder from base to top (3,)."""
        base, top = np.asarray(base, dtype=float), np.asarray(top, dtype=float)
        axis = (top - base) / np.linalg.norm(top - base)
        helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        u = np.cross(axis, helper)
        u /= np.linalg.norm(u)
        v = np.cross(axis, u)
        angle = 2.0 * np.pi * np.arange(sides + 1) / sides
        ring = radius * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
        rows = [np.tile(base, (sides + 1, 1)), base + ring, top + ring,
                np.tile(top, (sides + 1, 1))]  # fmt: skip
        self.sheet(np.stack(rows), material)

    def extrude(
        self, profile: np.ndarray, path: np.ndarray, heading: np.ndarray, material: str
    ) -> None:
        """Sweep a profile (m, 2: left, up) along a path (n, 3) with headings (n,) rad."""
        left = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros_like(heading)])
        grid = path[:, None, :] + profile[None, :, 0, None] * left[:, None, :]
        grid[..., 2] += profile[None, :, 1]
        self.sheet(grid, material)

    def leaves(
        self,
        center: np.ndarray,
        radii: tuple[float, float, float],
        count: int,
        size: float,
        rng: np.random.Generator,
        material: str = "leaf",
    ) -> None:
        """Add foliage: count small triangles in an ellipsoid, denser towards its skin."""
        direction = rng.standard_normal((count, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        depth = rng.uniform(0.35, 1.0, size=count) ** 0.5
        middle = center + direction * depth[:, None] * np.asarray(radii)
        corners = middle[:, None, :] + size * rng.standard_normal((count, 3, 3)) * 0.6
        self.triangles(corners, material)


def _turn(points: np.ndarray, yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = points.T
    return np.column_stack([c * x - s * y, s * x + c * y, z])
