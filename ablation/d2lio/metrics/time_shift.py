# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The time shift that suits a trajectory best: whether its stamps mean what they should."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from d2lio.datasets.events import NS_PER_S, Float64
from d2lio.errors import DataError
from d2lio.metrics.alignment import aligned_rmse
from d2lio.metrics.tum import Trajectory, finite, read_tum

LIMIT_S = 0.2
GRID_S = 0.01
TOLERANCE_S = 1e-5
MIN_POSES = 10
MIN_EXTENT_M = 0.1  # RMS about the mean; what stands still has no time
MIN_CONTRAST = 1e-3  # of the error over the grid; along a straight way at one speed there is none
MIN_CHANGE_M = 1e-6  # nor there, where the error is but rounding
DENSER = 1.5  # as in `matching`: the denser trajectory is interpolated


def best_time_shift(
    estimate: Path | Trajectory, truth: Path | Trajectory, limit_s: float = LIMIT_S
) -> float | None:
    """The shift within ±limit_s that, added to the estimate's stamps, makes the ATE smallest.

    The ATE is the RMSE of positions after an SE(3) alignment. Poses nearer than limit_s to the ends
    of the other trajectory are left out, so that every shift compares the same poses.

    Returns:
        Seconds; None where nothing shows it: an unreadable file, few poses, no motion.
    """
    try:
        estimate = read_tum(estimate) if isinstance(estimate, Path) else estimate
        truth = read_tum(truth) if isinstance(truth, Path) else truth
    except DataError:
        return None
    estimate, truth = estimate.select(finite(estimate)), truth.select(finite(truth))
    if min(len(estimate), len(truth)) < MIN_POSES:
        return None
    if truth.period_s <= DENSER * estimate.period_s:
        return _search(truth, estimate, 1.0, limit_s)
    return _search(estimate, truth, -1.0, limit_s)


def _search(dense: Trajectory, sparse: Trajectory, sign: float, limit_s: float) -> float | None:
    origin = dense.stamps[0]
    known = (dense.stamps - origin) / NS_PER_S
    times = (sparse.stamps - origin) / NS_PER_S
    kept = (times >= limit_s) & (times <= known[-1] - limit_s)
    times, fixed = times[kept], sparse.positions[kept]
    if len(times) < MIN_POSES or _spread(fixed) < MIN_EXTENT_M:
        return None

    def error(shift: float) -> float:
        at = times + sign * shift
        moved = np.stack([np.interp(at, known, dense.positions[:, i]) for i in range(3)], axis=1)
        return aligned_rmse(moved, fixed)

    grid = np.linspace(-limit_s, limit_s, 2 * round(limit_s / GRID_S) + 1)
    errors = np.array([error(shift) for shift in grid])
    if np.ptp(errors) <= max(MIN_CONTRAST * errors.max(), MIN_CHANGE_M):
        return None
    best = int(errors.argmin())
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    options = {"xatol": TOLERANCE_S}
    return float(minimize_scalar(error, bounds=bounds, method="bounded", options=options).x)


def _spread(positions: Float64) -> float:
    return float(np.sqrt(((positions - positions.mean(axis=0)) ** 2).sum(axis=1).mean()))
