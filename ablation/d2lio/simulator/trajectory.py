# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Continuous-time trajectories: quintic B-splines in position and Euler angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

KNOT_SPACING = 0.02  # s; wobble stays below 8 Hz, so the spline follows it closely
MARGIN = 0.2  # s of spline beyond both ends, where the not-a-knot ends may bend it
DEGREE = 5  # C^4: jerk is smooth, so the specific force is twice differentiable
STANDSTILL = 2.0  # s
PathFunction = Callable[[np.ndarray], np.ndarray]


class Trajectory:
    """T_world_imu as a function of time t in s, 0 <= t <= duration.

    The orientation is R = Rz(yaw) Ry(pitch) Rx(roll); pitch stays well inside ±90°.
    """

    def __init__(self, t: np.ndarray, position: np.ndarray, angles: np.ndarray, duration: float):
        """Interpolate samples: t (n,) s, position (n, 3) m, angles (n, 3) yaw, pitch, roll rad."""
        self.duration = float(duration)
        self._pose = make_interp_spline(t, np.column_stack([position, angles]), k=DEGREE)
        self._rate = self._pose.derivative(1)
        self._acceleration = self._pose.derivative(2)

    def pose(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (n, 3) m in the world and R_world_imu (n, 3, 3) at times t (n,) s."""
        state = self._pose(t)
        return state[:, :3], euler_to_matrix(state[:, 3:])

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Velocity (n, 3) m/s in the world."""
        return self._rate(t)[:, :3]

    def acceleration(self, t: np.ndarray) -> np.ndarray:
        """Acceleration (n, 3) m/s² in the world."""
        return self._acceleration(t)[:, :3]

    def angular_rate(self, t: np.ndarray) -> np.ndarray:
        """Exact angular rate (n, 3) rad/s in the body frame, from the Euler-angle rates."""
        _, pitch, roll = self._pose(t)[:, 3:].T
        yaw_rate, pitch_rate, roll_rate = self._rate(t)[:, 3:].T
        return np.column_stack(
            [
                roll_rate - yaw_rate * np.sin(pitch),
                pitch_rate * np.cos(roll) + yaw_rate * np.sin(roll) * np.cos(pitch),
                -pitch_rate * np.sin(roll) + yaw_rate * np.cos(roll) * np.cos(pitch),
            ]
        )

    def quaternion(self, t: np.ndarray) -> np.ndarray:
        """Unit quaternions (n, 4), x y z w, of R_world_imu."""
        half = 0.5 * self._pose(t)[:, 3:]
        (cy, cp, cr), (sy, sp, sr) = np.cos(half).T, np.sin(half).T
        return np.column_stack(
            [
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
                cr * cp * cy + sr * sp * sy,
            ]
        )


def euler_to_matrix(angles: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of yaw, pitch, roll (n, 3) in rad."""
    (cy, cp, cr), (sy, sp, sr) = np.cos(angles).T, np.sin(angles).T
    matrix = np.empty((len(angles), 3, 3))
    matrix[:, 0, 0], matrix[:, 1, 0], matrix[:, 2, 0] = cy * cp, sy * cp, -sp
    matrix[:, 0, 1], matrix[:, 1, 1] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr
    matrix[:, 0, 2], matrix[:, 1, 2] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr
    matrix[:, 2, 1], matrix[:, 2, 2] = cp * sr, cp * cr
    return matrix


@dataclass(frozen=True)
class Ride:
    """How a body shakes while it moves: amplitudes (1 σ) and frequency bands in Hz."""

    heave_m: float = 0.006
    sway_m: float = 0.004
    roll_rad: float = 0.006
    pitch_rad: float = 0.006
    yaw_rad: float = 0.004
    band_hz: tuple[float, float] = (0.4, 1.8)
    vibration_m: float = 0.0004
    vibration_rad: float = 0.0004
    vibration_band_hz: tuple[float, float] = (4.0, 7.5)


def smooth_step(x: np.ndarray) -> np.ndarray:
    """Septic smooth step from 0 to 1 over 0 <= x <= 1 (three vanishing derivatives per end)."""
    x = np.clip(x, 0.0, 1.0)
    return x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)


def smooth_noise(
    t: np.ndarray, rng: np.random.Generator, sigma: float, band: tuple[float, float], terms: int = 5
) -> np.ndarray:
    """Band-limited noise (n,): a sum of sines with random phase and standard deviation sigma."""
    frequency = rng.uniform(*band, size=terms)
    phase = rng.uniform(0.0, 2.0 * np.pi, size=terms)
    waves = np.sin(2.0 * np.pi * frequency * t[:, None] + phase)
    return sigma * np.sqrt(2.0 / terms) * waves.sum(axis=1)


def time_grid(duration: float) -> np.ndarray:
    """Sample times (n,) s of the spline, a margin beyond both ends included."""
    count = int(np.ceil((duration + 2.0 * MARGIN) / KNOT_SPACING)) + 1
    return -MARGIN + KNOT_SPACING * np.arange(count)


def integrate(t: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Running trapezoid integral (n,) of rate over t, zero at the first sample."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def activity(t: np.ndarray, ramp: float, standstill: float = STANDSTILL) -> np.ndarray:
    """0 during the standstill, rising smoothly to 1 within ramp seconds (n,)."""
    return smooth_step((t - standstill) / ramp)


def _add_ride(
    t: np.ndarray,
    gain: np.ndarray,
    position: np.ndarray,
    angles: np.ndarray,
    ride: Ride,
    rng: np.random.Generator,
) -> None:
    slow = ((position, 2, ride.heave_m), (position, 1, ride.sway_m), (angles, 0, ride.yaw_rad),
            (angles, 1, ride.pitch_rad), (angles, 2, ride.roll_rad))  # fmt: skip
    for target, column, sigma in slow:
        target[:, column] += gain * smooth_noise(t, rng, sigma, ride.band_hz)
    for column in range(3):
        position[:, column] += gain * smooth_noise(t, rng, ride.vibration_m, ride.vibration_band_hz)
        angles[:, column] += gain * smooth_noise(t, rng, ride.vibration_rad, ride.vibration_band_hz)


def drive(
    path: PathFunction,
    speed: float,
    duration: float,
    rng: np.random.Generator,
    *,
    ramp: float = 3.0,
    ride: Ride = Ride(),
    roll: Callable[[np.ndarray], np.ndarray] | None = None,
    speed_variation: float = 0.06,
) -> Trajectory:
    """A vehicle that starts from standstill and follows a path, nose along its tangent.

    Args:
        path: maps travelled parameter s (n,) m to positions (n, 3) m of the IMU.
        speed: cruise speed in m/s.
        duration: s, standstill included.
        rng: source of speed variation and shaking.
        ramp: s from standstill to cruise speed.
        ride: shaking, scaled with speed.
        roll: maps s (n,) to the roll angle (n,) rad the ground imposes.
        speed_variation: relative 1 σ of the slow speed changes.
    """
    t = time_grid(duration)
    gain = activity(t, ramp)
    variation = smooth_noise(t, rng, speed_variation, (0.03, 0.12))
    s = integrate(t, speed * gain * (1.0 + variation))
    step = 0.25  # m; the tangent of a body with a wheel base, not of a point
    tangent = (path(s + step) - path(s - step)) / (2.0 * step)
    angles = np.zeros((len(t), 3))
    angles[:, 0] = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    angles[:, 1] = -np.arctan2(tangent[:, 2], np.hypot(tangent[:, 0], tangent[:, 1]))
    if roll is not None:
        angles[:, 2] = roll(s)
    position = path(s)
    _add_ride(t, gain, position, angles, ride, rng)
    return Trajectory(t, position, angles, duration)


def handheld(
    loop: PathFunction, rate: float, duration: float, rng: np.random.Generator
) -> Trajectory:
    """A person carrying the sensor along a closed loop, looking about briskly.

    Args:
        loop: maps phase (n,) rad to positions (n, 3) m; 2π closes it.
        rate: mean phase rate in rad/s.
        duration: s, standstill included.
        rng: source of gait and gaze.
    """
    t = time_grid(duration)
    gain = activity(t, 2.0)
    phase = integrate(t, rate * gain * (1.0 + smooth_noise(t, rng, 0.12, (0.08, 0.25))))
    tangent = loop(phase + 0.05) - loop(phase - 0.05)
    angles = np.zeros((len(t), 3))
    angles[:, 0] = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    angles[:, 0] += gain * smooth_noise(t, rng, 0.35, (0.15, 0.5))
    angles[:, 1] += gain * smooth_noise(t, rng, 0.14, (0.2, 0.7))
    angles[:, 2] += gain * smooth_noise(t, rng, 0.10, (0.2, 0.7))
    position = loop(phase)
    position[:, 2] += gain * smooth_noise(t, rng, 0.08, (0.1, 0.4))
    gait = Ride(0.012, 0.01, 0.012, 0.012, 0.012, (1.6, 2.2), 0.0006, 0.001, (4.0, 7.0))
    _add_ride(t, gain, position, angles, gait, rng)
    return Trajectory(t, position, angles, duration)
