# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories in TUM files: `t x y z qx qy qz qw`, seconds and metres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from d2lio.datasets.events import NS_PER_S
from d2lio.datasets.timing import seconds
from d2lio.errors import DataError
from d2lio.output import write_tum

COLUMNS = 8


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A sequence of poses.

    Attributes:
        stamps: int64 [N], ns.
        positions: float64 [N, 3], m.
        quaternions: float64 [N, 4], x y z w, of unit length.
        position_only: the file holds no orientation (0 0 0 0); quaternions are identity then.
    """

    stamps: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray
    position_only: bool = False

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def path_m(self) -> float:
        """Length of the path, m."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    @property
    def period_s(self) -> float:
        """Median time between poses, s; 0 for less than two poses."""
        return float(np.median(np.diff(self.stamps))) / NS_PER_S if len(self) > 1 else 0.0

    def select(self, index: np.ndarray) -> Trajectory:
        """The poses at `index` (integers or a mask)."""
        return replace(
            self,
            stamps=self.stamps[index],
            positions=self.positions[index],
            quaternions=self.quaternions[index],
        )


def _nanoseconds(text: str) -> int:
    """Seconds as text, exactly; exponents go through a float."""
    if "e" in text.lower():
        return round(float(text) * NS_PER_S)
    negative = text.startswith("-")
    whole, _, fraction = text.lstrip("+-").partition(".")
    value = int(whole or "0") * NS_PER_S + int(fraction.ljust(9, "0")[:9] or "0")
    return -value if negative else value


def read_tum(path: Path) -> Trajectory:
    """Reads a TUM file, blank or comma separated; `#` begins a comment line.

    Poses with NaN are kept (see `finite`); quaternions are normalised.

    Raises:
        DataError: unreadable, empty, wrong number of columns, stamps that do not grow.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as err:
        raise DataError(f"{path}: cannot be read: {err}") from None
    rows = [(n, line.replace(",", " ").split()) for n, line in enumerate(lines, 1)]
    rows = [(n, cells) for n, cells in rows if cells and not cells[0].startswith("#")]
    if not rows:
        raise DataError(f"{path}: holds no poses")
    for number, cells in rows:
        if len(cells) != COLUMNS:
            raise DataError(f"{path}:{number}: {len(cells)} columns instead of {COLUMNS}")
    try:
        stamps = np.array([_nanoseconds(cells[0]) for _, cells in rows], np.int64)
        values = np.array([cells[1:] for _, cells in rows]).astype(np.float64)
    except ValueError as err:
        raise DataError(f"{path}: {err}") from None
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if len(back):
        raise DataError(f"{path}:{rows[back[0] + 1][0]}: stamps do not grow")
    return _build(stamps, values)


def _build(stamps: np.ndarray, values: np.ndarray) -> Trajectory:
    quaternions = values[:, 3:]
    norms = np.linalg.norm(quaternions, axis=1)
    position_only = bool((norms == 0.0).all())
    if position_only:
        quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    else:
        quaternions = quaternions / np.where(norms > 0.0, norms, np.nan)[:, None]
    return Trajectory(stamps, values[:, :3], quaternions, position_only)


def finite(trajectory: Trajectory) -> np.ndarray:
    """Mask [N] of the poses without NaN or infinity."""
    return np.isfinite(trajectory.positions).all(axis=1) & np.isfinite(trajectory.quaternions).all(
        axis=1
    )


def write(path: Path, trajectory: Trajectory) -> None:
    """Writes a TUM file, nine decimals of time, every other number in full precision."""
    poses = np.hstack([trajectory.positions, trajectory.quaternions]).tolist()
    write_tum(
        path,
        (
            f"{seconds(stamp)} {' '.join(map(repr, pose))}\n"
            for stamp, pose in zip(trajectory.stamps.tolist(), poses, strict=True)
        ),
    )


def interpolate(trajectory: Trajectory, stamps: np.ndarray, max_gap_s: float) -> Trajectory:
    """Poses at other times: positions linear, attitudes spherical-linear.

    Args:
        trajectory: dense poses.
        stamps: int64 [M], ns.
        max_gap_s: times between poses further apart than this, or outside, are left out.
    """
    if len(trajectory) < 2:
        return trajectory.select(np.isin(trajectory.stamps, stamps))
    right = np.clip(np.searchsorted(trajectory.stamps, stamps), 1, len(trajectory) - 1)
    gap = trajectory.stamps[right] - trajectory.stamps[right - 1]
    exact = np.isin(stamps, trajectory.stamps)
    inside = (stamps >= trajectory.stamps[0]) & (stamps <= trajectory.stamps[-1])
    keep = inside & (exact | (gap <= max_gap_s * NS_PER_S))
    stamps, right = stamps[keep], right[keep]
    # Relative to the first stamp: floats hold nanoseconds only for small numbers.
    origin = trajectory.stamps[0]
    times = (trajectory.stamps - origin).astype(np.float64)
    query = (stamps - origin).astype(np.float64)
    share = ((query - times[right - 1]) / (times[right] - times[right - 1]))[:, None]
    before, after = trajectory.positions[right - 1], trajectory.positions[right]
    positions = before + share * (after - before)
    rotations = Slerp(times, Rotation.from_quat(trajectory.quaternions))
    quaternions = rotations(query).as_quat() if len(stamps) else np.empty((0, 4))
    return Trajectory(stamps, positions, quaternions, trajectory.position_only)
