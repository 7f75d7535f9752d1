# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the studies over seeds of simulated scenes share: runs, their errors, their hosts."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from scipy.spatial.transform import Rotation

from d2lio.datasets import ImuBlock, Source, timed_events
from d2lio.datasets.events import Float64
from d2lio.errors import DataError
from d2lio.hosts import NEED_GTSAM, liosam_missing, load_host
from d2lio.metrics import Trajectory
from d2lio.metrics.tum import interpolate
from d2lio.source_params import all_params

METHOD = "noise_aware"
REJECTION: dict[str, str | None] = {"fastlio": "off", "d2lio": None}  # None: the host's default
MAX_GAP_S = 0.05  # of the ground truth, which has the IMU's rate


@dataclass(frozen=True, slots=True)
class Track:
    """What a host estimated.

    Attributes:
        trajectory: T_map_imu at the ends of the scans.
        covariance: float64 [N, 6, 6], x y z rx ry rz in the map, m and rad.
    """

    trajectory: Trajectory
    covariance: Float64


def track(source: Source, host: str, rejection: str | None, method: str | None = METHOD) -> Track:
    """Runs a host over a recording on one thread; None leaves mode or method to the host.

    Raises:
        DataError: no scan gave a pose.
    """
    params = all_params(source.config, host, rejection, method, {})
    estimator = load_host(host)(params, 1)
    poses: list[tuple[int, Float64, Float64]] = []

    def drain() -> None:
        while (result := estimator.step()) is not None:
            if result.has_pose:
                pose = np.array(result.T_map_imu)
                poses.append((result.stamp, pose, np.array(result.covariance)))

    for event in timed_events(source.reader, log_times=source.log_times):
        if isinstance(event, ImuBlock):
            estimator.add_imu(event.stamps, event.gyro, event.accel, event.orientation)
        else:
            estimator.add_scan(event.stamp, event.xyz, event.dt_ns, event.intensity, event.ring)
        drain()
    estimator.finish()
    drain()
    if not poses:
        raise DataError(f"{source.name}: {host} gave no pose")
    stamps, matrices, covariance = (np.array(column) for column in zip(*poses, strict=True))
    quaternions = Rotation.from_matrix(matrices[:, :3, :3]).as_quat()
    return Track(Trajectory(stamps, matrices[:, :3, 3], quaternions), covariance)


def pose_errors(estimate: Track, truth: Trajectory) -> Float64:
    """Errors with the first pose aligned, x y z rx ry rz in the map, m and rad, float64 [N, 6].

    Raises:
        DataError: the truth does not cover the estimate.
    """
    poses = estimate.trajectory
    true = interpolate(truth, poses.stamps, MAX_GAP_S)
    if len(true) < len(poses):
        raise DataError("the ground truth does not cover the estimate")
    rotation, rotation_true = (Rotation.from_quat(p.quaternions) for p in (poses, true))
    to_map = rotation[0] * rotation_true[0].inv()
    motion = to_map.apply(true.positions - true.positions[0])
    turned = rotation * (to_map * rotation_true).inv()
    return np.hstack([poses.positions - poses.positions[0] - motion, turned.as_rotvec()])


def built_hosts(
    parser: argparse.ArgumentParser, options: argparse.Namespace, console: Console
) -> list[str]:
    """Those of `--hosts` that are built; the others are said. Ends the program for a wrong one."""
    hosts = options.hosts.split(",")
    if options.seeds < 1 or not set(hosts) <= set(REJECTION):
        parser.error(f"--seeds must be at least 1, --hosts among {', '.join(REJECTION)}")
    why = liosam_missing()
    if why is None:
        return hosts
    console.print(f"left out: {', '.join(NEED_GTSAM)}, {why}", highlight=False)
    return [host for host in hosts if host not in NEED_GTSAM]
