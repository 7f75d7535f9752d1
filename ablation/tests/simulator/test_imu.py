# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""IMU samples agree with the trajectory, and their errors with the stated densities."""

from __future__ import annotations

import numpy as np
import pytest
from d2lio.simulator import imu
from d2lio.simulator.imu import GRAVITY, IMU_GRADES
from d2lio.simulator.scenes import SCENES
from d2lio.simulator.trajectory import Trajectory
from scipy.spatial.transform import Rotation

DURATION = 20.0  # s
SAME_POSE = (1e-3, 1e-4)  # m, rad: dense samples
SAME_POSE_200_HZ = (1e-2, 1e-3)  # m, rad: what the sampling itself costs


def trajectory_of(scene: str) -> Trajectory:
    return (
        SCENES[scene].build(np.random.default_rng(1), np.random.default_rng(2), DURATION).trajectory
    )


def integrate(trajectory: Trajectory, rate_hz: int) -> tuple[np.ndarray, Rotation]:
    """Dead reckoning from the true initial state; trapezoid rule, constant mean rate per step."""
    count = int(DURATION * rate_hz) + 1
    t = np.linspace(0.0, DURATION, count)
    gyro, accel = imu.ideal(trajectory, t)
    dt = 1.0 / rate_hz
    start, rotation = trajectory.pose(t[:1])
    turn = Rotation.from_rotvec(0.5 * (gyro[1:] + gyro[:-1]) * dt)
    attitude = [Rotation.from_matrix(rotation[0])]
    for step in turn:
        attitude.append(attitude[-1] * step)
    force = Rotation.concatenate(attitude).apply(accel) - [0.0, 0.0, GRAVITY]
    change = 0.5 * (force[1:] + force[:-1]) * dt
    velocity = trajectory.velocity(t[:1]) + np.vstack([np.zeros(3), np.cumsum(change, axis=0)])
    travelled = 0.5 * (velocity[1:] + velocity[:-1]) * dt
    return start[0] + travelled.sum(axis=0), attitude[-1]


@pytest.mark.parametrize(
    ("rate_hz", "tolerance"), [(1000, SAME_POSE), (imu.RATE_HZ, SAME_POSE_200_HZ)]
)
@pytest.mark.parametrize("scene", ["room", "tunnel"])
def test_integrating_the_ideal_imu_gives_the_true_pose(
    scene: str, rate_hz: int, tolerance: tuple[float, float]
) -> None:
    trajectory = trajectory_of(scene)
    position, attitude = integrate(trajectory, rate_hz)
    end = np.array([DURATION])
    true_position, true_rotation = trajectory.pose(end)
    turn = attitude.inv() * Rotation.from_matrix(true_rotation[0])
    assert np.linalg.norm(position - true_position[0]) < tolerance[0]
    assert turn.magnitude() < tolerance[1]


def test_quaternions_and_matrices_agree() -> None:
    trajectory = trajectory_of("room")
    t = np.linspace(0.0, DURATION, 200)
    _, rotation = trajectory.pose(t)
    from_quaternion = Rotation.from_quat(trajectory.quaternion(t)).as_matrix()
    np.testing.assert_allclose(from_quaternion, rotation, atol=1e-12)


def test_the_body_stands_still_at_first_and_then_moves() -> None:
    trajectory = trajectory_of("tunnel_cabinets")
    gyro, accel = imu.ideal(trajectory, np.linspace(0.1, 1.9, 50))
    assert np.abs(gyro).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(accel, axis=1), GRAVITY, atol=1e-4)
    assert np.linalg.norm(trajectory.velocity(np.array([10.0]))) > 1.0


def test_room_motion_is_brisk_in_all_axes() -> None:
    t = np.linspace(0.0, DURATION, 2000)
    assert np.all(np.abs(trajectory_of("room").angular_rate(t)).max(axis=0) > 0.3)


def test_white_noise_and_walk_follow_their_densities() -> None:
    count, seeds = 4000, 60
    white, walk, constant = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        white.append(imu.corrupt(np.zeros((count, 3)), 2e-3, 0.0, 0.0, 0.0, rng).std())
        walk.append(imu.corrupt(np.zeros((count, 3)), 0.0, 3e-4, 0.0, 0.0, rng)[-1])
        constant.append(imu.corrupt(np.ones((2, 3)), 0.0, 0.0, 0.1, 0.01, rng)[0] - 1.0)
    seconds = count / imu.RATE_HZ
    assert np.mean(white) == pytest.approx(2e-3 * np.sqrt(imu.RATE_HZ), rel=0.01)
    assert np.std(walk) == pytest.approx(3e-4 * np.sqrt(seconds), rel=0.2)
    assert np.std(constant) == pytest.approx(np.hypot(0.1, 0.01), rel=0.2)


def test_grades_get_better_in_order() -> None:
    fields = ("gyro_noise", "accel_noise", "gyro_walk", "accel_walk", "gyro_bias", "accel_bias")
    grades = [IMU_GRADES[name] for name in ("consumer", "industrial", "tactical")]
    for field in fields:
        values = [getattr(grade, field) for grade in grades]
        assert values == sorted(values, reverse=True)
