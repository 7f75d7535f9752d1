# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Ground truth of the known data sets as poses of the IMU."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.datasets.catalog import Truth
from d2lio.errors import DataError
from d2lio.metrics.tum import Trajectory, read_tum, write

CSV_COLUMNS = 8
FAR_M = 1e4  # positions further out are map coordinates (UTM)


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """Poses and what their frame is.

    Attributes:
        trajectory: T_world_imu where `in_imu_frame`, else of the truth's own body. Its origin may
            lie far out (UTM); `origin` [3] was taken off all positions, m.
        in_imu_frame: whether the device's transform is known and was applied (or is identity).
        T_gt_imu: [4, 4], p_gt = T p_imu, None where unknown.
        notes: what an evaluation must know.
    """

    trajectory: Trajectory
    in_imu_frame: bool
    T_gt_imu: np.ndarray | None
    origin: np.ndarray
    notes: list[str]


def read_csv_ns(path: Path) -> Trajectory:
    """SubT-MRS: a header line, then ns, x y z, qx qy qz qw; also without the header.

    Raises:
        DataError: unreadable, too few columns, stamps that do not grow.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = [row for row in csv.reader(stream) if row and row[0].strip()]
    except (OSError, UnicodeDecodeError) as err:
        raise DataError(f"{path}: cannot be read: {err}") from None
    if rows and not rows[0][0].strip().lstrip("+-").isdigit():
        rows = rows[1:]
    if not rows:
        raise DataError(f"{path}: holds no poses")
    short = next((n for n, row in enumerate(rows, 1) if len(row) < CSV_COLUMNS), None)
    if short is not None:
        raise DataError(f"{path}: pose {short} has less than {CSV_COLUMNS} columns")
    try:
        stamps = np.array([int(row[0]) for row in rows], np.int64)
        values = np.array([row[1:CSV_COLUMNS] for row in rows]).astype(np.float64)
    except ValueError as err:
        raise DataError(f"{path}: {err}") from None
    if (np.diff(stamps) <= 0).any():
        raise DataError(f"{path}: stamps do not grow")
    norms = np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
    if not norms.any():
        return Trajectory(
            stamps, values[:, :3], np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1)), True
        )
    return Trajectory(stamps, values[:, :3], values[:, 3:] / np.where(norms > 0.0, norms, np.nan))


def read_truth(path: Path, truth: Truth, device: str) -> GroundTruth:
    """Ground truth moved to the IMU of `device` where its transform is known.

    Truth without attitude cannot be moved: it stays at its own body, and the estimate must be moved
    there instead (`at_truth_body`).

    Raises:
        DataError: unreadable.
    """
    as_csv = truth.format == "csv_ns" and path.suffix.lower() == ".csv"
    trajectory = read_csv_ns(path) if as_csv else read_tum(path)
    notes = list(truth.notes)
    origin = np.zeros(3)
    if np.abs(trajectory.positions[0]).max() > FAR_M:
        origin = trajectory.positions[0].copy()
        trajectory = replace(trajectory, positions=trajectory.positions - origin)
        notes.append("positions are relative to the first: " + _numbers(origin))
    pose = truth.devices.get(device)
    T_gt_imu = None if pose is None else pose.matrix()
    if T_gt_imu is None:
        notes.append(f"body frame of the truth: {truth.body}; not moved to the IMU")
        return GroundTruth(trajectory, False, None, origin, notes)
    if trajectory.position_only:
        same = bool(np.allclose(T_gt_imu, np.eye(4)))
        if not same:
            notes.append(
                f"positions of {truth.body} without attitude: the estimate must be moved there"
            )
        return GroundTruth(trajectory, same, T_gt_imu, origin, notes)
    return GroundTruth(moved(trajectory, T_gt_imu), True, T_gt_imu, origin, notes)


def write_truth(path: Path, truth: GroundTruth) -> None:
    """Writes TUM; positions without attitude keep their quaternion 0 0 0 0.

    Raises:
        DataError: cannot be written.
    """
    trajectory = truth.trajectory
    if trajectory.position_only:  # an identity would be taken for an attitude
        trajectory = replace(trajectory, quaternions=np.zeros((len(trajectory), 4)))
    write(path, trajectory)


def moved(trajectory: Trajectory, T_body_other: np.ndarray) -> Trajectory:
    """Poses of another frame fixed to the same body: T_world_other = T_world_body T_body_other.

    Raises:
        DataError: a trajectory without attitude.
    """
    if trajectory.position_only:
        raise DataError("positions without attitude cannot be moved to another frame")
    rotation = Rotation.from_quat(trajectory.quaternions)
    positions = trajectory.positions + rotation.apply(T_body_other[:3, 3])
    quaternions = (rotation * Rotation.from_matrix(T_body_other[:3, :3])).as_quat(canonical=True)
    return replace(trajectory, positions=positions, quaternions=quaternions)


def at_truth_body(estimate: Trajectory, truth: GroundTruth) -> Trajectory:
    """An estimate of the IMU at the body of position-only truth; unchanged where none is known."""
    if truth.in_imu_frame or truth.T_gt_imu is None:
        return estimate
    return moved(estimate, np.linalg.inv(truth.T_gt_imu))


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{v:.3f}" for v in values)
