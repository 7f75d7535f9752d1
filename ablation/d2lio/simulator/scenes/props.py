# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Things several scenes share: roads, terrain, trees, cars, poles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.trajectory import Trajectory, activity, integrate, time_grid
from d2lio.simulator.world import Body, Mover

CAR_LENGTH = 4.4  # m


@dataclass(frozen=True)
class Road:
    """A gently winding centre line y = amplitude sin(2π x / wavelength + phase), x = s in m."""

    amplitude: float
    wavelength: float
    phase: float = 0.0

    def heading(self, s: np.ndarray) -> np.ndarray:
        """Direction (n,) rad of the line at s (n,)."""
        wave = 2.0 * np.pi / self.wavelength
        return np.arctan(self.amplitude * wave * np.cos(wave * s + self.phase))

    def at(self, s: np.ndarray, left: float | np.ndarray = 0.0, up: float = 0.0) -> np.ndarray:
        """Points (n, 3) at s (n,), left of the line and above the ground by so many metres."""
        s = np.asarray(s, dtype=float)
        heading = self.heading(s)
        y = self.amplitude * np.sin(2.0 * np.pi / self.wavelength * s + self.phase)
        return np.stack(
            [s - left * np.sin(heading), y + left * np.cos(heading), np.full_like(s, up)], axis=-1
        )

    def point(self, s: float, left: float, up: float = 0.0) -> tuple[np.ndarray, float]:
        """One such point (3,), and the heading there."""
        return self.at(np.array([s]), left, up)[0], float(self.heading(np.array([s]))[0])

    def strip(self, mesh: Mesh, profile: np.ndarray, s: np.ndarray, material: str) -> None:
        """Sweep a profile (m, 2: left, up) along the line."""
        mesh.extrude(np.asarray(profile, dtype=float), self.at(s), self.heading(s), material)


class Terrain:
    """Rolling ground: a sum of plane waves of random direction."""

    def __init__(
        self,
        rng: np.random.Generator,
        sigma: float,
        wavelengths: tuple[float, float],
        waves: int = 14,
    ) -> None:
        """Draw the waves; sigma is the standard deviation of the height in m."""
        length = np.exp(rng.uniform(*np.log(wavelengths), size=waves))
        angle, self._phase = rng.uniform(0.0, 2.0 * np.pi, size=(2, waves))
        self._wave = 2.0 * np.pi / length * np.stack([np.cos(angle), np.sin(angle)])
        weight = length**0.8  # long waves are higher
        self._amplitude = sigma * weight * np.sqrt(2.0 / np.sum(weight**2))

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Height in m at x, y (any equal shapes)."""
        total = np.zeros(np.broadcast(x, y).shape)
        for kx, ky, phase, amplitude in zip(*self._wave, self._phase, self._amplitude, strict=True):
            total += amplitude * np.sin(kx * x + ky * y + phase)
        return total


def ground(mesh: Mesh, x: np.ndarray, y: np.ndarray, height: np.ndarray, material: str) -> None:
    """Add a height field: x (n,), y (m,), height (n, m)."""
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), height], axis=-1)
    mesh.sheet(grid, material)


def tree(mesh: Mesh, foot: np.ndarray, rng: np.random.Generator, leaves: int = 450) -> None:
    """A tree of 4 to 9 m with its foot (3,) on the ground."""
    height = rng.uniform(4.0, 9.0)
    lean = np.array([*rng.normal(0.0, 0.25, 2), height * 0.7])
    mesh.cylinder(foot - np.array([0.0, 0.0, 0.3]), foot + lean, rng.uniform(0.1, 0.28), "wood", 9)
    crown = rng.uniform(0.2, 0.32) * height
    mesh.leaves(foot + lean, (crown, crown, crown * rng.uniform(0.9, 1.4)), leaves, 0.16, rng)


def bush(mesh: Mesh, foot: np.ndarray, rng: np.random.Generator, leaves: int = 160) -> None:
    """A bush of about a metre with its foot (3,) on the ground."""
    size = rng.uniform(0.4, 1.1)
    middle = foot + np.array([0.0, 0.0, 0.6 * size])
    mesh.leaves(middle, (size, size, 0.8 * size), leaves, 0.1, rng)


def pole(mesh: Mesh, foot: np.ndarray, height: float, radius: float = 0.08) -> None:
    """An upright pole."""
    mesh.cylinder(foot, foot + np.array([0.0, 0.0, height]), radius, "metal", 12)


def car(mesh: Mesh, foot: np.ndarray, yaw: float, rng: np.random.Generator) -> None:
    """A passenger car or a van; foot (3,) is the ground below its middle."""
    c, s = np.cos(yaw), np.sin(yaw)

    def at(forward: float, left: float, up: float) -> tuple[float, float, float]:
        return (foot[0] + c * forward - s * left, foot[1] + s * forward + c * left, foot[2] + up)

    length, width = CAR_LENGTH * rng.uniform(0.92, 1.08), rng.uniform(1.7, 1.85)
    van = rng.random() < 0.2
    mesh.box(at(0.0, 0.0, 0.6), (length, width, 0.65), "car", yaw)
    cabin = (length * 0.9, width * 0.97, 1.1) if van else (length * 0.55, width * 0.95, 0.55)
    mesh.box(at(-0.2, 0.0, 0.92 + cabin[2] / 2), cabin, "car" if van else "glass", yaw,
             0.94 if van else 0.78)  # fmt: skip
    if not van:
        mesh.box(at(-0.2, 0.0, 1.48), (length * 0.4, width * 0.7, 0.04), "car", yaw)
    for forward in (-0.3 * length, 0.3 * length):
        for left in (-0.5 * width, 0.5 * width):
            inner, outer = at(forward, left * 0.85, 0.31), at(forward, left * 1.02, 0.31)
            mesh.cylinder(np.array(inner), np.array(outer), 0.31, "rubber", 12)
    for end in (-0.5, 0.5):  # number plates
        mesh.box(at(end * (length + 0.02), 0.0, 0.5), (0.02, 0.5, 0.11), "sign", yaw)


def moving_car(
    road: Road,
    start: float,
    left: float,
    speed: float,
    duration: float,
    rng: np.random.Generator,
    ramp: float | None = None,
) -> Mover:
    """A car on a lane of the road; a negative speed (m/s) comes the other way.

    With a ramp (s) it waits through the standstill and sets off together with the sensor.
    """
    mesh = Mesh()
    car(mesh, np.zeros(3), 0.0, rng)
    t = time_grid(duration)
    s = start + speed * (t if ramp is None else integrate(t, activity(t, ramp)))
    turn = np.pi if speed < 0.0 else 0.0
    return Mover(Body(mesh), _along(road, s, left, turn, t, duration))


def pedestrian(road: Road, start: float, left: float, speed: float, duration: float) -> Mover:
    """A walking person, coarsely: legs, trunk and head."""
    mesh = Mesh()
    mesh.box((0.0, 0.0, 0.42), (0.24, 0.32, 0.84), "rubber")
    mesh.box((0.0, 0.0, 1.15), (0.26, 0.46, 0.62), "wood")
    mesh.box((0.0, 0.0, 1.62), (0.2, 0.18, 0.26), "wood")
    t = time_grid(duration)
    return Mover(Body(mesh), _along(road, start + speed * t, left, 0.0, t, duration))


def _along(
    road: Road, s: np.ndarray, left: float, turn: float, t: np.ndarray, duration: float
) -> Trajectory:
    angles = np.zeros((len(t), 3))
    angles[:, 0] = road.heading(s) + turn
    return Trajectory(t, road.at(s, left), angles, duration)
