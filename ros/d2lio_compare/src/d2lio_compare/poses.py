# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Poses: quaternions x y z w, and TUM files."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NS_PER_S = 1_000_000_000


class Truth(NamedTuple):
    """Stamps int64 [N] ns, positions [N, 3] m, quaternions [N, 4] or zeros where unknown."""

    stamps: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray


NO_TRUTH = Truth(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 4)))


def nanoseconds(text: str) -> int:
    """Seconds as text, exactly."""
    if "e" in text.lower():
        return round(float(text) * NS_PER_S)
    whole, _, fraction = text.lstrip("+").partition(".")
    return int(whole or "0") * NS_PER_S + int(fraction.ljust(9, "0")[:9] or "0")


def read_tum(file: str) -> Truth:
    """Reads `t x y z qx qy qz qw`.

    Raises:
        OSError, ValueError: unreadable, or not such a file.
    """
    stamps, rows = [], []
    with open(file, encoding="utf-8") as stream:
        for number, line in enumerate(stream, 1):
            cells = line.replace(",", " ").split()
            if not cells or cells[0].startswith("#"):
                continue
            if len(cells) != 8:
                raise ValueError(f"{file}:{number}: {len(cells)} columns instead of 8")
            stamps.append(nanoseconds(cells[0]))
            rows.append([float(cell) for cell in cells[1:]])
    if not rows:
        raise ValueError(f"{file}: holds no poses")
    values = np.array(rows)
    return Truth(np.array(stamps, np.int64), values[:, :3], values[:, 3:])


def tum_line(stamp: int, position: np.ndarray, quaternion: np.ndarray) -> str:
    """One line, nine decimals of time and every other number in full precision."""
    numbers = " ".join(repr(float(value)) for value in (*position, *quaternion))
    return f"{stamp // NS_PER_S}.{stamp % NS_PER_S:09d} {numbers}\n"


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix [3, 3] of a quaternion of any length but zero."""
    x, y, z, w = np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """x y z w of a rotation matrix: the eigenvector of Bar-Itzhack (2000), sure at every angle."""
    r = rotation
    symmetric = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    _, vectors = np.linalg.eigh(symmetric)
    found = vectors[:, -1]
    return found if found[3] >= 0.0 else -found


def start_in_map(
    truth: Truth, stamp: int, position: np.ndarray, quaternion: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """R [3, 3], t [3] that bring the truth's pose nearest in time onto an estimate's pose.

    None where the truth has no attitudes or does not reach there.
    """
    index = int(np.abs(truth.stamps - stamp).argmin()) if len(truth.stamps) else -1
    if index < 0 or abs(int(truth.stamps[index]) - stamp) > NS_PER_S // 2:
        return None
    if not truth.quaternions[index].any():
        return None
    rotation = matrix(quaternion) @ matrix(truth.quaternions[index]).T
    return rotation, position - rotation @ truth.positions[index]
