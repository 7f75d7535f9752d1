# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the studies over seeds of simulated scenes share: runs, their errors, their hosts."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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


def scans(
    source: Source,
    host: str,
    rejection: str | None,
    method: str | None = METHOD,
    extra: Mapping[str, str] | None = None,
) -> Iterator[Any]:
    """Runs a host over a recording on one thread: the `ScanResult` of every scan with a pose.

    Args:
        source: the recording.
        host: name of the estimator.
        rejection: mode; None leaves it to the host.
        method: for weak directions; None leaves it to the host.
        extra: other parameters.
    """
    params = all_params(source.config, host, rejection, method, extra or {})
    estimator = load_host(host)(params, 1)

    def ready() -> Iterator[Any]:
        while (result := estimator.step()) is not None:
            if result.has_pose:
                yield result

    for event in timed_events(source.reader, log_times=source.log_times):
        if isinstance(event, ImuBlock):
            estimator.add_imu(event.stamps, event.gyro, event.accel, event.orientation)
        else:
            estimator.add_scan(event.stamp, event.xyz, event.dt_ns, event.intensity, event.ring)
        yield from ready()
    estimator.finish()
    yield from ready()


def trajectory_of(results: Sequence[Any]) -> Trajectory:
    """T_map_imu at the ends of the scans."""
    poses = np.array([result.T_map_imu for result in results])
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return Trajectory(np.array([r.stamp for r in results]), poses[:, :3, 3], quaternions)


def track(source: Source, host: str, rejection: str | None, method: str | None = METHOD) -> Track:
    """Runs a host over a recording on one thread; None leaves mode or method to the host.

    Raises:
        DataError: no scan gave a pose.
    """
    results = list(scans(source, host, rejection, method))
    if not results:
        raise DataError(f"{source.name}: {host} gave no pose")
    return Track(trajectory_of(results), np.array([result.covariance for result in results]))


def in_map(truth: Trajectory, poses: Trajectory) -> Trajectory:
    """The truth at the times of the poses, moved so that the first of them agrees with it.

    Raises:
        DataError: the truth does not cover the estimate.
    """
    true = interpolate(truth, poses.stamps, MAX_GAP_S)
    if len(true) < len(poses):
        raise DataError("the ground truth does not cover the estimate")
    rotation = Rotation.from_quat(true.quaternions)
    to_map = Rotation.from_quat(poses.quaternions[0]) * rotation[0].inv()
    positions = poses.positions[0] + to_map.apply(true.positions - true.positions[0])
    return Trajectory(poses.stamps, positions, (to_map * rotation).as_quat())


def pose_errors(estimate: Track, truth: Trajectory) -> Float64:
    """Errors with the first pose aligned, x y z rx ry rz in the map, m and rad, float64 [N, 6].

    Raises:
        DataError: the truth does not cover the estimate.
    """
    poses = estimate.trajectory
    true = in_map(truth, poses)
    turned = Rotation.from_quat(poses.quaternions) * Rotation.from_quat(true.quaternions).inv()
    return np.hstack([poses.positions - true.positions, turned.as_rotvec()])


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
