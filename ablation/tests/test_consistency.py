# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""NEES on drawn errors, and that published covariances cover the hosts' errors on short drives."""

from __future__ import annotations

import numpy as np
import pytest
from built import host_params
from d2lio import consistency, seeds
from d2lio.consistency import MOMENTS, band, nees
from d2lio.errors import DataError
from d2lio.metrics import Trajectory
from d2lio.seeds import REJECTION, Track, pose_errors
from scipy.spatial.transform import Rotation

DRAWS = 4000
SCATTER = 5.0  # sigmas of the mean of that many draws
DURATION = 10.0  # s, of which 2 s standstill
SEEDS = (0, 1)
OVER_CONFIDENT = 3.0  # NEES / 6, mean of two seeds and five moments; upstream's covariance: > 10
VAGUE = 0.05

each_host = pytest.mark.parametrize("host", host_params(tuple(REJECTION)))


def trajectory(positions: np.ndarray, rotations: Rotation) -> Trajectory:
    stamps = np.arange(len(positions), dtype=np.int64) * 10_000_000
    return Trajectory(stamps, positions, rotations.as_quat())


@pytest.fixture
def truth() -> Trajectory:
    rng = np.random.default_rng(1)
    return trajectory(rng.normal(size=(20, 3)), Rotation.random(20, random_state=2))


def test_nees_of_drawn_errors_is_their_freedom() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    errors = rng.normal(size=(DRAWS, 6)) @ root.T
    found = nees(errors, np.broadcast_to(root @ root.T, (DRAWS, 6, 6)))
    for values, freedom in ((found.pose, 6), (found.position, 3), (found.rotation, 3)):
        slack = SCATTER * np.sqrt(2.0 * freedom / DRAWS)
        assert values.mean() == pytest.approx(freedom, abs=slack)


def test_nees_is_none_where_a_covariance_is_singular() -> None:
    found = nees(np.ones((1, 6)), np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])[None])
    assert np.isnan(found.pose[0])
    assert np.isnan(found.rotation[0])
    assert found.position[0] == pytest.approx(3.0)


def test_band_of_many_seeds_is_narrow_around_one() -> None:
    low, high = band(5)
    assert (low, high) == pytest.approx((0.560, 1.566), abs=1e-3)  # chi-square table, 30 degrees
    assert band(500)[0] > 0.94
    assert band(500)[1] < 1.06


def test_a_map_with_another_origin_has_no_error(truth: Trajectory) -> None:
    turn, move = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([3.0, 2.0, 1.0])
    rotations = turn * Rotation.from_quat(truth.quaternions)
    moved = trajectory(turn.apply(truth.positions) + move, rotations)
    errors = pose_errors(Track(moved, np.zeros((20, 6, 6))), truth)
    assert np.abs(errors).max() < 1e-9


def test_errors_are_in_the_axes_of_the_map(truth: Trajectory) -> None:
    turn = Rotation.from_rotvec([0.0, 0.0, 0.5])
    off, tilt = np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.01, 0.0])
    positions, rotations = turn.apply(truth.positions), turn * Rotation.from_quat(truth.quaternions)
    positions[5] += off
    quaternions = rotations.as_quat()
    quaternions[5] = (Rotation.from_rotvec(tilt) * rotations[5]).as_quat()
    poses = trajectory(positions, Rotation.from_quat(quaternions))
    errors = pose_errors(Track(poses, np.zeros((20, 6, 6))), truth)
    assert errors[5] == pytest.approx(np.concatenate([off, tilt]), abs=1e-9)
    assert np.abs(np.delete(errors, 5, axis=0)).max() < 1e-9


def test_a_truth_that_ends_early_is_refused(truth: Trajectory) -> None:
    short = Trajectory(truth.stamps[:10], truth.positions[:10], truth.quaternions[:10])
    with pytest.raises(DataError, match="cover"):
        pose_errors(Track(truth, np.zeros((20, 6, 6))), short)


@pytest.mark.parametrize("scene", ["room", "tunnel_cabinets"])
@each_host
def test_the_covariance_covers_the_error(host: str, scene: str) -> None:
    values = [
        consistency.measure(scene, seed, [host], DURATION)[host].pose[1:] / 6.0 for seed in SEEDS
    ]
    assert VAGUE < np.mean(values) < OVER_CONFIDENT


def test_command_prints_scene_by_scene(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = "--scenes room --seeds 1 --hosts fastlio --duration 4"
    assert consistency.main(arguments.split()) == 0
    shown = capsys.readouterr().out
    assert "room, fastlio" in shown
    assert all(f"{moment:.0%}" in shown for moment in MOMENTS)


def test_command_leaves_out_what_is_not_built(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seeds, "liosam_missing", lambda: "no GTSAM")
    assert consistency.main(["--scenes", "room", "--hosts", "d2lio"]) == 0
    assert "left out" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", ["--seeds 0", "--hosts none"])
def test_command_refuses_what_it_cannot_run(arguments: str) -> None:
    with pytest.raises(SystemExit) as stopped:
        consistency.main(arguments.split())
    assert stopped.value.code == 2
