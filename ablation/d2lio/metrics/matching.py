# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Brings estimate and ground truth to common times before evo compares them.

evo pairs the nearest stamps. At 20 m/s a pair 5 ms apart is 10 cm of error that nobody made, so
the denser trajectory is interpolated to the stamps of the sparser one first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from d2lio.datasets.events import NS_PER_S
from d2lio.metrics.tum import Trajectory, interpolate

GAP_PERIODS = 5.0  # a gap longer than this many median periods is a hole
MIN_GAP_S = 0.3
START_UP_S = 1.0  # an estimator may take this long to initialise

Interpolated = Literal["truth", "estimate", "none"]


@dataclass(frozen=True, slots=True)
class Matched:
    """Both trajectories; `interpolated` says which of them was interpolated."""

    truth: Trajectory
    estimate: Trajectory
    interpolated: Interpolated


def max_gap_s(trajectory: Trajectory) -> float:
    """Longest time between two poses that still counts as continuous, s."""
    return max(GAP_PERIODS * trajectory.period_s, MIN_GAP_S)


def match(truth: Trajectory, estimate: Trajectory) -> Matched:
    """Interpolates the denser one to the other's stamps; what cannot be matched is left out.

    A sparse truth (1 Hz GNSS, a total station) is not interpolated across its long gaps; there
    the estimate, at scan rate, is.
    """
    if truth.period_s <= estimate.period_s * 1.5:
        moved = interpolate(truth, estimate.stamps, max_gap_s(truth))
        kept = estimate.select(np.isin(estimate.stamps, moved.stamps))
        return Matched(moved, kept, "truth")
    moved = interpolate(estimate, truth.stamps, max_gap_s(estimate))
    kept = truth.select(np.isin(truth.stamps, moved.stamps))
    return Matched(kept, moved, "estimate")


def coverage(truth: Trajectory, estimate: Trajectory) -> float:
    """Share of the truth's time span in which the estimate has poses without a hole, in [0, 1].

    Up to START_UP_S at the start and MIN_GAP_S at the end count as covered, so that a complete
    run reaches 1.
    """
    begin, end = int(truth.stamps[0]), int(truth.stamps[-1])
    if end <= begin:
        return 0.0
    stamps = estimate.stamps[(estimate.stamps >= begin) & (estimate.stamps <= end)]
    if len(stamps) == 0:
        return 0.0
    gaps = np.diff(stamps) / NS_PER_S
    covered = float(gaps[gaps <= max_gap_s(estimate)].sum())
    for edge, granted in ((stamps[0] - begin, START_UP_S), (end - stamps[-1], MIN_GAP_S)):
        covered += edge / NS_PER_S if edge <= granted * NS_PER_S else 0.0
    return min(1.0, covered / ((end - begin) / NS_PER_S))
