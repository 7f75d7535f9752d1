# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The absolute pose error while a run is under way: at its end the number that evo gives.

Same rules as d2lio.metrics.matching: the denser trajectory is interpolated to the stamps of the
sparser one, never across a hole; then a rigid alignment (Umeyama 1991, without scale).
"""

from __future__ import annotations

from typing import Tuple

import numpy as np

NS_PER_S = 1_000_000_000
MAX_RATIO = 1.5  # of the truth's period to the estimate's: beyond, the estimate is interpolated
GAP_PERIODS = 5.0
MIN_GAP_S = 0.3
MIN_PAIRS = 3

Rigid = Tuple[np.ndarray, np.ndarray]


def align(points: np.ndarray, target: np.ndarray) -> Rigid:
    """R [3, 3], t [3] that move points [N, 3] onto their partners."""
    center, goal = points.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - goal).T @ (points - center))
    handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ handed @ vt
    return rotation, goal - rotation @ center


def interpolate(
    stamps: np.ndarray, positions: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions [M, 3] at those of the wanted stamps, ns, that lie inside and in no hole; mask."""
    if len(stamps) < 2:
        mask = np.isin(wanted, stamps)
        return np.repeat(positions[:1], int(mask.sum()), axis=0), mask
    right = np.clip(np.searchsorted(stamps, wanted), 1, len(stamps) - 1)
    gap = stamps[right] - stamps[right - 1]
    inside = (wanted >= stamps[0]) & (wanted <= stamps[-1])
    longest = max(GAP_PERIODS * _period_s(stamps), MIN_GAP_S) * NS_PER_S
    mask = inside & (np.isin(wanted, stamps) | (gap <= longest))
    right, wanted = right[mask], wanted[mask]
    # Integers first: a stamp in ns does not fit a float.
    share = (wanted - stamps[right - 1]) / (stamps[right] - stamps[right - 1])
    before, after = positions[right - 1], positions[right]
    return before + share[:, None] * (after - before), mask


def _period_s(stamps: np.ndarray) -> float:
    return float(np.median(np.diff(stamps))) / NS_PER_S if len(stamps) > 1 else 0.0


class RunningApe:
    """Poses of one variant as they come, against the truth."""

    def __init__(self, truth_stamps: np.ndarray, truth_positions: np.ndarray) -> None:
        self._truth = truth_stamps.astype(np.int64), truth_positions.astype(np.float64)
        self._stamps: list[int] = []
        self._positions: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._stamps)

    def set_truth(self, stamps: np.ndarray, positions: np.ndarray) -> None:
        """More of the truth is known."""
        self._truth = stamps.astype(np.int64), positions.astype(np.float64)

    def add(self, stamp: int, position: np.ndarray) -> bool:
        """A pose: ns, [3] m. One that is not finite, or older than the last, is left out."""
        if not np.isfinite(position).all() or (self._stamps and stamp <= self._stamps[-1]):
            return False
        self._stamps.append(int(stamp))
        self._positions.append(np.asarray(position, np.float64))
        return True

    def clear(self) -> None:
        """A new epoch: the poses so far belong to another trajectory."""
        self._stamps, self._positions = [], []

    def pairs(self, until: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stamps [N] ns, estimate and truth [N, 3] m at the same times, up to `until`."""
        stamps = np.array(self._stamps, np.int64)
        positions = np.array(self._positions, np.float64).reshape(-1, 3)
        if until is not None:
            kept = stamps <= until
            stamps, positions = stamps[kept], positions[kept]
        known, places = self._truth
        if not len(stamps) or not len(known):
            return np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
        if _period_s(known) <= MAX_RATIO * _period_s(stamps):
            moved, mask = interpolate(known, places, stamps)
            return stamps[mask], positions[mask], moved
        moved, mask = interpolate(stamps, positions, known)
        return known[mask], moved, places[mask]

    def rmse(self, until: int | None = None) -> float | None:
        """APE (RMSE of positions, m) after alignment of all poses so far; None for too few."""
        _, estimate, truth = self.pairs(until)
        if len(estimate) < MIN_PAIRS or not np.ptp(truth, axis=0).any():
            return None
        try:
            rotation, translation = align(estimate, truth)
        except np.linalg.LinAlgError:
            return None
        rest = estimate @ rotation.T + translation - truth
        return float(np.sqrt((rest**2).sum(axis=1).mean()))
