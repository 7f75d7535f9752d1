# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The time shift that suits a trajectory best."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from d2lio.metrics import tum
from d2lio.metrics.time_shift import aligned_rmse, best_time_shift
from d2lio.metrics.tum import Trajectory
from scipy.spatial.transform import Rotation

NS = 1_000_000_000
START = 1_700_000_000 * NS
SHIFT_TOLERANCE_S = 1e-3  # the truth is interpolated, the noise is 1 mm


def winding(t: np.ndarray) -> np.ndarray:
    """A way with turns and changing speed, m."""
    return np.stack([3.0 * np.sin(0.7 * t), 2.0 * np.cos(1.1 * t), 0.3 * t], axis=1)


def trajectory(t: np.ndarray, positions: np.ndarray) -> Trajectory:
    stamps = START + np.round(t * NS).astype(np.int64)
    return Trajectory(stamps, positions, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)))


TRUTH_T = np.arange(0.0, 20.0, 0.005)
TRUTH = trajectory(TRUTH_T, winding(TRUTH_T))


def estimate(late_s: float, period_s: float = 0.1) -> Trajectory:
    """Poses that are those of `late_s` after their stamps, elsewhere in space."""
    rng = np.random.default_rng(1)
    t = np.arange(0.5, 19.0, period_s)
    turn = Rotation.from_rotvec([0.3, -0.2, 1.0])
    positions = turn.apply(winding(t + late_s)) + np.array([5.0, -3.0, 1.0])
    return trajectory(t, positions + rng.normal(0.0, 1e-3, positions.shape))


@pytest.mark.parametrize("late_s", [-0.15, -0.05, 0.0, 0.0333, 0.1])
def test_a_shift_is_found(late_s: float) -> None:
    found = best_time_shift(estimate(late_s), TRUTH)
    assert found is not None
    assert abs(found - late_s) < SHIFT_TOLERANCE_S


@pytest.mark.parametrize("late_s", [-0.05, 0.1])
def test_a_sparse_truth_keeps_the_sign(late_s: float) -> None:
    t = np.arange(0.0, 20.0, 1.0)
    found = best_time_shift(estimate(late_s, 0.02), trajectory(t, winding(t)))
    assert found is not None
    assert abs(found - late_s) < SHIFT_TOLERANCE_S


def test_beyond_the_limit_it_is_the_limit() -> None:
    found = best_time_shift(estimate(0.4), TRUTH)
    assert found is not None
    assert abs(found - 0.2) < SHIFT_TOLERANCE_S


def test_nothing_shows_it() -> None:
    t = TRUTH_T
    straight = trajectory(t, np.outer(t, [1.0, 0.5, 0.0]))
    still = trajectory(t, np.zeros((len(t), 3)))
    coarse = t[100:3000:20]
    for truth in (straight, still):
        positions = truth.positions[100:3000:20]
        assert best_time_shift(trajectory(coarse, positions), truth) is None
    assert best_time_shift(estimate(0.0).select(np.arange(5)), TRUTH) is None


def test_poses_that_are_not_finite_are_left_out() -> None:
    bad = estimate(0.05)
    bad.positions[7] = np.nan
    found = best_time_shift(bad, TRUTH)
    assert found is not None
    assert abs(found - 0.05) < SHIFT_TOLERANCE_S


def test_from_files(tmp_path: Path) -> None:
    one, two = tmp_path / "estimate.tum", tmp_path / "truth.tum"
    tum.write(one, estimate(0.05))
    tum.write(two, TRUTH)
    found = best_time_shift(one, two)
    assert found is not None
    assert abs(found - 0.05) < SHIFT_TOLERANCE_S
    assert best_time_shift(tmp_path / "none.tum", two) is None


def test_the_alignment_is_rigid() -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(size=(50, 3))
    moved = Rotation.random(random_state=3).apply(points) + np.array([1.0, 2.0, 3.0])
    assert aligned_rmse(points, moved) < 1e-12
    assert aligned_rmse(points, points * [1.0, 1.0, -1.0]) > 0.1  # no reflection
    assert aligned_rmse(points, 2.0 * points) > 0.1  # no scale
