# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""IMU samples from a trajectory: white noise, bias random walk, scale error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.simulator.trajectory import Trajectory, smooth_noise

GRAVITY = 9.81  # m/s², along -z of the world
RATE_HZ = 200


@dataclass(frozen=True)
class ImuGrade:
    """Error model of one IMU class. Initial biases and scale errors are 1 σ per axis."""

    description: str
    gyro_noise: float  # rad/s/√Hz
    accel_noise: float  # m/s²/√Hz
    gyro_walk: float  # rad/s²/√Hz
    accel_walk: float  # m/s³/√Hz
    gyro_bias: float  # rad/s
    accel_bias: float  # m/s²
    gyro_scale: float  # 1
    accel_scale: float  # 1


IMU_GRADES: dict[str, ImuGrade] = {
    "ideal": ImuGrade(
        "nearly perfect: for tests of the geometry alone", 1e-6, 1e-5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ),
    "tactical": ImuGrade(
        "tactical MEMS, as in the STIM300 or ADIS16495",
        3.5e-5, 2.5e-4, 1e-6, 2e-5, 1e-4, 8e-3, 3e-4, 3e-4,
    ),
    "industrial": ImuGrade(
        "calibrated industrial MEMS, as in the Xsens MTi or BMI088",
        2.4e-4, 1.7e-3, 2e-5, 3e-4, 3e-3, 4e-2, 1.5e-3, 1.5e-3,
    ),
    "consumer": ImuGrade(
        "uncalibrated consumer MEMS, as in the MPU-6050",
        5e-4, 3.5e-3, 1e-4, 1e-3, 1.5e-2, 1.2e-1, 8e-3, 8e-3,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class AhrsErrors:
    """Error of an attitude filter, 1 σ in rad, wandering within a band in Hz."""

    tilt: float = np.deg2rad(0.5)  # roll and pitch, each
    heading: float = np.deg2rad(2.0)
    tilt_band_hz: tuple[float, float] = (0.01, 0.1)
    heading_band_hz: tuple[float, float] = (0.003, 0.02)


def attitude(
    trajectory: Trajectory,
    stamps: np.ndarray,
    rng: np.random.Generator,
    errors: AhrsErrors = AhrsErrors(),
) -> np.ndarray:
    """Orientation as a 9-axis IMU gives it, x y z w of R_world_imu (n, 4), at stamps (n,) ns."""
    t = stamps * 1e-9
    level = [smooth_noise(t, rng, errors.tilt, errors.tilt_band_hz) for _ in range(2)]
    heading = smooth_noise(t, rng, errors.heading, errors.heading_band_hz)
    error = Rotation.from_euler("ZYX", np.column_stack([heading, *level]))
    return (error * Rotation.from_quat(trajectory.quaternion(t))).as_quat(canonical=True)


def sample_times(duration: float) -> np.ndarray:
    """Sample times (n,) int64 ns from the start of the trajectory to its end."""
    period = 1_000_000_000 // RATE_HZ
    return np.arange(0, round(duration * 1e9) + 1, period, dtype=np.int64)


def ideal(trajectory: Trajectory, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Exact angular rate and specific force at t (n,) s, both (n, 3) in the body frame.

    f = R^T (a - g), g = (0, 0, -9.81).
    """
    _, rotation = trajectory.pose(t)
    force_world = trajectory.acceleration(t) + np.array([0.0, 0.0, GRAVITY])
    force = np.einsum("nji,nj->ni", rotation, force_world)
    return trajectory.angular_rate(t), force


def corrupt(
    true: np.ndarray,
    noise: float,
    walk: float,
    bias: float,
    scale: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Add scale error, bias, bias walk and white noise (densities per √Hz) to true (n, 3)."""
    count = len(true)
    factor = 1.0 + scale * rng.standard_normal(3)
    start = bias * rng.standard_normal(3)
    steps = walk / np.sqrt(RATE_HZ) * rng.standard_normal((count, 3))
    steps[0] = 0.0
    white = noise * np.sqrt(RATE_HZ) * rng.standard_normal((count, 3))
    return factor * true + start + np.cumsum(steps, axis=0) + white


def measure(
    trajectory: Trajectory, stamps: np.ndarray, grade: ImuGrade, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Measured angular rate rad/s and specific force m/s², both (n, 3), at stamps (n,) ns."""
    rate, force = ideal(trajectory, stamps * 1e-9)
    gyro = corrupt(rate, grade.gyro_noise, grade.gyro_walk, grade.gyro_bias, grade.gyro_scale, rng)
    accel = corrupt(
        force, grade.accel_noise, grade.accel_walk, grade.accel_bias, grade.accel_scale, rng
    )
    return gyro, accel
