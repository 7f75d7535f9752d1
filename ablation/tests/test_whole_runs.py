# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Whole runs of the C++ hosts: the real drive, the real MCAP, the axis of a bare tunnel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from built import host_params
from d2lio.datasets import open_source
from d2lio.metrics import evaluate, read_tum
from d2lio.metrics.tum import interpolate
from d2lio.report.diagnostics import read_diagnostics
from d2lio.runner import RunOptions, run
from d2lio.simulator import simulate
from scipy.spatial.transform import Rotation

KITTI = "kitti_raw_2011_09_26_drive_0001"
KITTI_ATE_PERCENT = 1.0
AXIS_DEG = 2.0
AXIS_SHARE = 0.95


@pytest.mark.parametrize("host", host_params())
@pytest.mark.parametrize("mode", ["off", "point_adaptive"])
def test_real_drive_within_one_percent(host: str, mode: str, tmp_path: Path, real_data) -> None:
    source = open_source(real_data(KITTI))
    assert source.ground_truth is not None
    record = run(source, RunOptions(host=host, rejection=mode, threads=2), tmp_path / "run")
    assert record.status == "complete"
    assert record.scans.read == 108
    result, _ = evaluate(tmp_path / "run" / "trajectory.tum", source.ground_truth)
    assert result.status == "ok", result.reason
    assert result.coverage > 0.97
    assert result.ate_percent is not None
    assert result.ate_percent < KITTI_ATE_PERCENT


def test_real_mcap_reaches_the_host_with_times_of_reception(tmp_path: Path, real_data) -> None:
    source = open_source(real_data("pointcloudset_ouster_mcap/test.mcap"), stamps="log")
    record = run(source, RunOptions(), tmp_path / "run")
    # Two scans in 0.18 s: they are read and refused for lack of IMU data, not lost silently.
    assert record.scans.read == 2
    assert record.scans.processed + sum(record.scans.dropped.values()) == 2
    assert record.imu_read == 17
    assert record.host_counts["imu_accepted"] > 0


def test_bare_tunnel_names_its_axis(tmp_path: Path) -> None:
    simulate("tunnel", tmp_path / "tunnel", seed=5, duration=10.0)
    source = open_source(tmp_path / "tunnel")
    assert source.ground_truth is not None
    record = run(source, RunOptions(rejection="point_adaptive"), tmp_path / "run")
    assert record.health["DEGENERATE"] >= AXIS_SHARE * record.scans.processed
    angles = _angles_to_world_x(tmp_path / "run", source.ground_truth)
    assert len(angles) > 80
    assert np.mean(angles < AXIS_DEG) >= AXIS_SHARE


def _angles_to_world_x(directory: Path, truth_file: Path) -> np.ndarray:
    """Angle of the weakest translation direction to the tunnel (world x), deg [N].

    The direction is given in the map frame; the body frame, which both trajectories share, leads
    to the world.
    """
    columns = read_diagnostics(directory / "diagnostics.csv")
    weakest = np.stack([columns[f"v_t_1_{axis}"] for axis in "xyz"], axis=1)
    estimate = read_tum(directory / "trajectory.tum")
    truth = interpolate(read_tum(truth_file), estimate.stamps, 0.1)
    assert len(truth) == len(estimate)
    in_map = weakest[-len(estimate) :]  # the rows before the first pose have none
    known = np.isfinite(in_map).all(axis=1)
    body = Rotation.from_quat(estimate.quaternions[known]).inv().apply(in_map[known])
    world = Rotation.from_quat(truth.quaternions[known]).apply(body)
    return np.rad2deg(np.arccos(np.clip(np.abs(world[:, 0]), 0.0, 1.0)))
