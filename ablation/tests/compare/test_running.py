# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The running APE is evo's, whatever the rates of truth and estimate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from d2lio.compare.shared.running import RunningApe
from d2lio.metrics import EvaluateOptions, Trajectory, evaluate, tum
from scipy.spatial.transform import Rotation

START_NS = 1_700_000_000_123_456_789
TOLERANCE_M = 1e-9
SEED = 5


def trajectory(rate_hz: float, seconds: float, noise_m: float, turned: bool) -> Trajectory:
    """A curve; `turned` puts it into another frame."""
    rng = np.random.default_rng(SEED)
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    places = np.stack([3.0 * t, 5.0 * np.sin(t), 0.3 * t], axis=1)
    places += noise_m * rng.standard_normal(places.shape)
    if turned:
        turn = Rotation.from_euler("xyz", [0.2, -0.1, 1.0])
        places = turn.apply(places) + np.array([10.0, -4.0, 2.0])
    stamps = START_NS + np.round(t * 1e9).astype(np.int64)
    return Trajectory(stamps, places, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)))


def with_hole(whole: Trajectory, begin_s: float, end_s: float) -> Trajectory:
    t = (whole.stamps - START_NS) * 1e-9
    return whole.select((t < begin_s) | (t > end_s))


def running(truth: Trajectory, estimate: Trajectory) -> RunningApe:
    ape = RunningApe(truth.stamps, truth.positions)
    for stamp, position in zip(estimate.stamps, estimate.positions, strict=True):
        assert ape.add(int(stamp), position)
    return ape


@pytest.mark.parametrize(
    ("truth_hz", "hole"),
    [(200.0, None), (10.0, None), (1.0, None), (200.0, (4.0, 6.0)), (1.0, (3.3, 6.2))],
    ids=["dense", "equal", "sparse", "dense with a hole", "sparse with a hole"],
)
def test_it_ends_at_what_evo_says(
    tmp_path: Path, truth_hz: float, hole: tuple[float, float] | None
) -> None:
    truth = trajectory(truth_hz, 12.0, 0.0, turned=False)
    if hole is not None:
        truth = with_hole(truth, *hole)
    estimate = trajectory(10.0, 12.0, 0.05, turned=True)
    tum.write(tmp_path / "truth.tum", truth)
    tum.write(tmp_path / "estimate.tum", estimate)
    options = EvaluateOptions(min_coverage=0.0)
    expected, _ = evaluate(tmp_path / "estimate.tum", tmp_path / "truth.tum", options)
    assert expected.ate is not None
    assert running(truth, estimate).rmse() == pytest.approx(expected.ate.rmse, abs=TOLERANCE_M)


def test_in_between_it_knows_the_poses_so_far() -> None:
    truth = trajectory(100.0, 12.0, 0.0, turned=False)
    estimate = trajectory(10.0, 12.0, 0.05, turned=True)
    half = estimate.select(np.arange(60))
    whole = running(truth, estimate)
    assert whole.rmse(until=int(half.stamps[-1])) == running(truth, half).rmse()


def test_without_truth_or_with_two_poses_there_is_no_figure() -> None:
    estimate = trajectory(10.0, 2.0, 0.0, turned=False)
    assert running(estimate.select(np.arange(0)), estimate).rmse() is None
    assert running(estimate, estimate.select(np.arange(2))).rmse() is None


def test_poses_that_are_not_finite_or_come_late_are_left_out() -> None:
    ape = RunningApe(np.arange(3), np.eye(3))
    assert ape.add(5, np.zeros(3))
    assert not ape.add(5, np.zeros(3))
    assert not ape.add(4, np.zeros(3))
    assert not ape.add(6, np.array([0.0, np.nan, 0.0]))
    assert len(ape) == 1
    ape.clear()
    assert ape.add(4, np.zeros(3))
