# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Curves of a run, read from the files it left."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.ablate.cell import TRUTH_FILE
from d2lio.datasets.events import NS_PER_S
from d2lio.errors import DataError
from d2lio.metrics.alignment import align
from d2lio.metrics.matching import match
from d2lio.metrics.tum import Trajectory, finite, read_tum
from d2lio.record import DIAGNOSTICS_FILE, TRAJECTORY_FILE
from d2lio.report.diagnostics import OUTCOMES, processed, read_diagnostics, rejected_by_range

MIN_PAIRS = 3  # fewer positions give no alignment

Array = np.ndarray
_truths: dict[tuple[int, ...], Trajectory] = {}  # the last one read, by what tells its file apart


@dataclass(slots=True)
class RunSeries:
    """What the figures need of one run; arrays are empty where it left nothing.

    Attributes:
        truth: m [M, 3].
        t, path, error: of the matched poses: s [N] from the truth's begin, m [N, 3] aligned to the
            truth (SE(3), least squares), m [N].
        restart: R [3, 3], t [3] that move `path` so that only the first poses agree; alignment as a
            whole hides how far a lost run stayed behind. None where the truth has no attitudes.
        t_scan, lambda_t, lambda_r: per processed scan: s [K], smallest eigenvalue of each block.
        shares: of the correspondences offered, by outcome, [0, 1].
        rejected_by_range: share rejected for each of diagnostics.RANGES; empty where unknown.
    """

    truth: Array = field(default_factory=lambda: np.empty((0, 3)))
    t: Array = field(default_factory=lambda: np.empty(0))
    path: Array = field(default_factory=lambda: np.empty((0, 3)))
    error: Array = field(default_factory=lambda: np.empty(0))
    restart: tuple[Array, Array] | None = None
    t_scan: Array = field(default_factory=lambda: np.empty(0))
    lambda_t: Array = field(default_factory=lambda: np.empty(0))
    lambda_r: Array = field(default_factory=lambda: np.empty(0))
    shares: dict[str, float] = field(default_factory=dict)
    rejected_by_range: list[float | None] = field(default_factory=list)


def read_series(directory: Path) -> RunSeries:
    """The curves of a run; a missing or broken file leaves its curves empty (the run failed)."""
    series = RunSeries()
    try:
        truth = _read_truth(directory / TRUTH_FILE)
    except (OSError, DataError):
        return series
    series.truth = truth.positions
    start = int(truth.stamps[0])
    with suppress(DataError):
        _add_path(series, truth, read_tum(directory / TRAJECTORY_FILE))
    with suppress(DataError):
        _add_diagnostics(series, read_diagnostics(directory / DIAGNOSTICS_FILE), start)
    return series


def _read_truth(file: Path) -> Trajectory:
    """The truth; the variants of a sequence share its file by hard links, and it is read once."""
    about = file.stat()
    key = about.st_dev, about.st_ino, about.st_mtime_ns, about.st_size
    if key not in _truths:
        _truths.clear()
        _truths[key] = read_tum(file)
    return _truths[key]


def _add_path(series: RunSeries, truth: Trajectory, estimate: Trajectory) -> None:
    good = estimate.select(finite(estimate))
    if len(good) < MIN_PAIRS or len(truth) < MIN_PAIRS:
        return
    pair = match(truth, good)
    if len(pair.truth) < MIN_PAIRS:
        return
    series.t = (pair.truth.stamps - truth.stamps[0]) / NS_PER_S
    R, t = align(pair.estimate.positions, pair.truth.positions)
    series.path = pair.estimate.positions @ R.T + t
    if not truth.position_only:
        R_start, t_start = _align_start(pair.truth, pair.estimate)
        series.restart = (R_start @ R.T, t_start - R_start @ R.T @ t)
    series.error = np.linalg.norm(series.path - pair.truth.positions, axis=1)


def _align_start(truth: Trajectory, estimate: Trajectory) -> tuple[Array, Array]:
    """R, t that move the estimate's first pose onto the truth's."""
    ours, theirs = (Rotation.from_quat(x.quaternions[0]) for x in (estimate, truth))
    turn = theirs * ours.inv()
    return turn.as_matrix(), truth.positions[0] - turn.apply(estimate.positions[0])


def _add_diagnostics(series: RunSeries, columns: dict[str, Array], start_ns: int) -> None:
    columns = processed(columns)
    stamps = columns.get("stamp_ns", np.empty(0))
    if not len(stamps):
        return
    series.t_scan = (stamps - start_ns) / NS_PER_S
    for block in ("t", "r"):
        values = columns.get(f"lambda_{block}_1")
        if values is not None and values.dtype.kind == "f":
            setattr(series, f"lambda_{block}", values)
    offered = float(np.nansum(columns["offered"])) if "offered" in columns else 0.0
    if offered > 0.0:
        series.shares = {
            label: float(np.nansum(columns[key])) / offered
            for key, label in OUTCOMES.items()
            if key in columns
        }
        series.rejected_by_range = rejected_by_range(columns)
