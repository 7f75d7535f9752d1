# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The current registered cloud of every variant, made of the recording and its trajectory.

Each point is placed at the pose of its own instant, so that a wrong motion shows as a smeared scan.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.compare.tracks import Track
from d2lio.datasets import ImuBlock, Source, timed_events
from d2lio.datasets.events import NS_PER_S, Scan
from d2lio.metrics.matching import max_gap_s
from d2lio.metrics.tum import interpolate

TOTAL_POINTS = 3_000_000  # of all clouds of a recording: 36 MB
SCAN_POINTS = 1000
REACH_M = 60.0


@dataclass(frozen=True, slots=True)
class Cloud:
    """The cloud of one variant at `stamp`, ns: float32 [N, 3], m, in the truth's frame."""

    track: Track
    stamp: int
    points: np.ndarray


def registered(source: Source, tracks: list[Track]) -> Iterator[Cloud]:
    """Clouds scan by scan; so many that all of them stay below TOTAL_POINTS.

    Raises:
        DataError: unreadable input.
    """
    drawn = [track for track in tracks if len(track.poses) > 1]
    if not drawn:
        return
    scans = source.reader.scan_total or max(len(track.poses) for track in drawn)
    step = max(1, -(-scans * len(drawn) * SCAN_POINTS // TOTAL_POINTS))
    number = -1
    for event in timed_events(source.reader, log_times=source.log_times):
        if isinstance(event, ImuBlock):
            continue
        number += 1
        if number % step:
            continue
        stamps, points = _chosen(event, source.config.extrinsic)
        for track in drawn if len(points) else ():
            cloud = _placed(track, stamps, points)
            if len(cloud):
                yield Cloud(track, int(stamps.max()), cloud)


def _chosen(scan: Scan, T_imu_lidar: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [N] ns and points [N, 3] in the body frame of some points, evenly over the scan."""
    distance = np.linalg.norm(scan.xyz, axis=1)
    usable = np.flatnonzero(np.isfinite(distance) & (distance > 0.5) & (distance < REACH_M))
    chosen = usable[:: max(1, len(usable) // SCAN_POINTS)][:SCAN_POINTS]
    points = scan.xyz[chosen] @ T_imu_lidar[:3, :3].T + T_imu_lidar[:3, 3]
    return scan.stamp + scan.dt_ns[chosen].astype(np.int64), points


def _placed(track: Track, stamps: np.ndarray, points: np.ndarray) -> np.ndarray:
    poses = track.poses
    near = slice(*np.searchsorted(poses.stamps, [stamps.min() - NS_PER_S, stamps.max() + NS_PER_S]))
    around = poses.select(np.arange(len(poses))[near])
    if len(around) < 2:
        return np.empty((0, 3), np.float32)
    unique, index = np.unique(stamps, return_inverse=True)
    at = interpolate(around, unique, max_gap_s(poses))
    known = np.isin(unique[index], at.stamps)
    row = np.searchsorted(at.stamps, unique[index][known])
    in_map = Rotation.from_quat(at.quaternions[row]).apply(points[known]) + at.positions[row]
    return (in_map @ track.R.T + track.t).astype(np.float32)
