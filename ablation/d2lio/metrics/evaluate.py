# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Scores one trajectory against ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from d2lio.datasets.events import NS_PER_S
from d2lio.errors import ConfigError, DataError
from d2lio.metrics import evo_metrics, tum
from d2lio.metrics.matching import coverage, match

MIN_COVERAGE = 0.95
FAIL_PERCENT = 5.0  # an ATE beyond this share of the path is shown as `-`, as in the paper


class Stats(BaseModel):
    """evo's statistics of an error."""

    model_config = ConfigDict(extra="ignore")

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float


class Evaluation(BaseModel):
    """Outcome of `evaluate`; figures are null where the run failed or they make no sense.

    Attributes:
        status: ok, or fail with its `reason`.
        coverage: share of the truth's time span covered, [0, 1].
        ate: absolute translation error after alignment, m.
        ate_percent: ate.rmse as a share of the truth's path, %.
        rpe_trans: relative translation error per `rpe_delta`, m; rpe_rot: deg.
        first_pose_ate: RMSE with only the first poses aligned, m (alignment over the whole path
            hides errors along straight degenerate paths).
        end_error_m: distance of the last pose then; end_error_percent: of the path.
        max_time_diff_s: largest difference between paired stamps.
        files: what evo's command line must be given for the same numbers.
    """

    status: Literal["ok", "fail"] = "ok"
    reason: str = ""
    poses: int = 0
    bad_poses: int = 0
    pairs: int = 0
    coverage: float = 0.0
    path_m: float = 0.0
    align: evo_metrics.Align = "se3"
    interpolated: str = "none"
    position_only: bool = False
    max_time_diff_s: float | None = None
    ate: Stats | None = None
    ate_percent: float | None = None
    rpe_delta: float = 10.0
    rpe_unit: evo_metrics.RpeUnit = "m"
    rpe_trans: Stats | None = None
    rpe_rot: Stats | None = None
    first_pose_ate: float | None = None
    end_error_m: float | None = None
    end_error_percent: float | None = None
    files: dict[str, str] = {}

    @property
    def lost(self) -> str:
        """Why the run counts as lost: not scored, or too far off; empty where it does not."""
        if self.status != "ok":
            return self.reason
        if self.ate_percent is None or self.ate_percent <= FAIL_PERCENT:
            return ""
        return f"ATE {self.ate_percent:.1f} % of the path, beyond {FAIL_PERCENT:g} %"


@dataclass(frozen=True, slots=True)
class EvaluateOptions:
    """How to compare; see `d2lio evaluate --help`.

    Attributes:
        t_max_diff: pairs may lie this far apart in time, s.
        interpolate: bring both to common times first.
        min_coverage: less than this fails the run.
        out: directory for the matched files; None puts them beside the estimate.
    """

    align: evo_metrics.Align = "se3"
    t_max_diff: float = 0.01
    rpe_delta: float = 10.0
    rpe_unit: evo_metrics.RpeUnit = "m"
    interpolate: bool = True
    min_coverage: float = MIN_COVERAGE
    out: Path | None = None

    def check(self) -> None:
        """Raises ConfigError for values that make no sense."""
        if self.align not in ("se3", "first", "none"):
            raise ConfigError("align", self.align, "se3, first, none")
        if self.rpe_unit not in ("m", "f"):
            raise ConfigError("rpe-unit", self.rpe_unit, "m, f")
        if not self.rpe_delta > 0.0:
            raise ConfigError("rpe-delta", self.rpe_delta, "> 0")
        if not self.t_max_diff >= 0.0:
            raise ConfigError("t-max-diff", self.t_max_diff, ">= 0 (s)")


@dataclass(frozen=True, slots=True)
class Curves:
    """For plots: t s [N] from the start; truth, estimate m [N, 3] aligned; error m [N]."""

    t: np.ndarray
    truth: np.ndarray
    estimate: np.ndarray
    error: np.ndarray


def evaluate(
    estimate_file: Path, truth_file: Path, options: EvaluateOptions | None = None
) -> tuple[Evaluation, Curves | None]:
    """Compares a TUM trajectory with the truth.

    A run with NaN poses, holes or too little coverage is not scored: status fail, its coverage
    shown. Curves are given for scored runs.

    Raises:
        DataError: a file that cannot be read; ConfigError: bad options.
    """
    options = options or EvaluateOptions()
    options.check()
    truth = tum.read_tum(truth_file)
    result = Evaluation(
        align=options.align,
        rpe_delta=options.rpe_delta,
        rpe_unit=options.rpe_unit,
        path_m=truth.path_m,
        position_only=truth.position_only,
    )
    try:
        estimate = tum.read_tum(estimate_file)
    except DataError as err:
        if not estimate_file.exists():
            raise
        return _fail(result, str(err)), None
    _cover(result, truth, estimate, options)
    if result.status == "fail":
        return result, None
    try:
        pair = _pair(result, truth, estimate, (truth_file, estimate_file), options)
        return result, _score(result, pair)
    except DataError as err:
        return _fail(result, str(err)), None


def _fail(result: Evaluation, reason: str) -> Evaluation:
    result.status, result.reason = "fail", reason
    return result


def _cover(
    result: Evaluation,
    truth: tum.Trajectory,
    estimate: tum.Trajectory,
    options: EvaluateOptions,
) -> None:
    good = tum.finite(estimate)
    result.poses = len(estimate)
    result.bad_poses = int((~good).sum())
    usable = estimate.select(good)
    result.coverage = coverage(truth, usable) if len(usable) else 0.0
    shown = f"coverage {100 * result.coverage:.1f} %"
    if result.bad_poses:
        _fail(result, f"{result.bad_poses} of {result.poses} poses are not finite; {shown}")
    elif result.coverage < options.min_coverage:
        _fail(result, f"{shown} is below {100 * options.min_coverage:.0f} %")


def _pair(
    result: Evaluation,
    truth: tum.Trajectory,
    estimate: tum.Trajectory,
    files: tuple[Path, Path],
    options: EvaluateOptions,
) -> tuple[Any, Any]:
    """Writes the matched files where needed and lets evo pair them."""
    truth_file, estimate_file = files
    if options.interpolate or truth.position_only:
        folder = options.out or estimate_file.parent
        if options.interpolate:
            matched = match(truth, estimate)
            truth, estimate = matched.truth, matched.estimate
            result.interpolated = matched.interpolated
        if len(truth) == 0:
            raise DataError("no pose of the estimate lies within the ground truth")
        truth_file = folder / f"{estimate_file.stem}.matched_truth.tum"
        tum.write(truth_file, truth)
        if result.interpolated != "none":
            estimate_file = folder / f"{estimate_file.stem}.matched_estimate.tum"
            tum.write(estimate_file, estimate)
    result.files = {"truth": str(truth_file), "estimate": str(estimate_file)}
    pair = evo_metrics.load_pair(truth_file, estimate_file, options.t_max_diff)
    result.pairs = pair[0].num_poses
    result.max_time_diff_s = float(np.abs(pair[0].timestamps - pair[1].timestamps).max())
    return pair


def _score(result: Evaluation, pair: tuple[Any, Any]) -> Curves:
    ape = evo_metrics.ape(pair, result.align)
    result.ate = Stats(**ape.stats)
    if result.path_m > 0.0:
        result.ate_percent = 100.0 * result.ate.rmse / result.path_m
    kind: Literal["distance", "translation"] = "distance" if result.position_only else "translation"
    delta, unit = result.rpe_delta, result.rpe_unit
    trans = evo_metrics.rpe(pair, kind, delta, unit)
    result.rpe_trans = Stats(**trans) if trans else None
    if not result.position_only:
        rot = evo_metrics.rpe(pair, "rotation", delta, unit)
        result.rpe_rot = Stats(**rot) if rot else None
        _score_first_pose(result, pair)
    stamps, truth, estimate = evo_metrics.aligned_positions(ape)
    error = np.linalg.norm(truth - estimate, axis=1)
    return Curves(stamps - stamps[0], truth, estimate, error)


def _score_first_pose(result: Evaluation, pair: tuple[Any, Any]) -> None:
    first = evo_metrics.ape(pair, "first")
    _, truth, estimate = evo_metrics.aligned_positions(first)
    result.first_pose_ate = float(first.stats["rmse"])
    result.end_error_m = float(np.linalg.norm(truth[-1] - estimate[-1]))
    if result.path_m > 0.0:
        result.end_error_percent = 100.0 * result.end_error_m / result.path_m


def span_s(trajectory: tum.Trajectory) -> float:
    """Time from the first to the last pose, s."""
    return float(trajectory.stamps[-1] - trajectory.stamps[0]) / NS_PER_S
