# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Orientation of 9-axis IMUs, from message or simulator to the host."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bags import IMU, NS, START, Recorded, drive, imu_message, ros1_store, write_bag
from d2lio.datasets import ImuBlock, SourceConfig, open_source
from d2lio.datasets.bag import BagReader, orientation_of
from d2lio.metrics import read_tum
from d2lio.runner import RunOptions, run
from d2lio.simulator import simulate
from d2lio.simulator.imu import AhrsErrors
from scipy.spatial.transform import Rotation

TURNED = (0.0, 0.6, 0.0, 0.8)
SIGMAS = 4.0  # a sum of five sines stays below sqrt(10) of its own deviation


@pytest.mark.parametrize(
    ("quaternion", "variance", "expected"),
    [
        (TURNED, 0.0, TURNED),
        (TURNED, 1e-4, TURNED),
        ((0.0, 0.603, 0.0, 0.804), 0.0, TURNED),  # rounded by the driver
        (TURNED, -1.0, None),
        ((0.0, 0.0, 0.0, 0.0), 0.0, None),
        ((0.0, 0.0, 0.0, 1.0), 0.0, None),  # never filled in
        ((0.0, 1.2, 0.0, 1.6), 0.0, None),
        ((float("nan"), 0.0, 0.0, 1.0), 0.0, None),
    ],
)
def test_what_counts_as_an_orientation(quaternion, variance, expected) -> None:
    message = imu_message(
        ros1_store(), START, orientation=quaternion, orientation_variance=variance
    )
    found = orientation_of(message)
    assert (found is None) == (expected is None)
    if expected is not None:
        assert found == pytest.approx(expected)


def _bag(path: Path) -> Path:
    """A bag whose last sample, received 1 s after the start, alone has an orientation."""
    messages = drive(8)
    sample = imu_message(ros1_store(), START + NS + 1, orientation=TURNED)
    messages.append(Recorded(START + 2 * NS, "/imu/data", IMU, sample))
    return write_bag(path, messages)


def test_samples_without_one_have_zeros(tmp_path: Path) -> None:
    events = list(BagReader(_bag(tmp_path / "a.bag"), SourceConfig()).raw_events())
    blocks = [event for event in events if isinstance(event, ImuBlock)]
    assert all(block.orientation is None for block in blocks[:-1])
    last = blocks[-1].orientation
    assert last is not None
    assert last.shape == (len(blocks[-1]), 4)
    assert not last[:-1].any()
    assert last[-1].tolist() == pytest.approx(TURNED)
    silent = SourceConfig.parse({"imu": {"orientation": False}})
    events = BagReader(tmp_path / "a.bag", silent).raw_events()
    assert all(e.orientation is None for e in events if isinstance(e, ImuBlock))


def test_the_runner_hands_it_on(tmp_path: Path, fake_host) -> None:
    source = open_source(_bag(tmp_path / "a.bag"))
    record = run(source, RunOptions(host=fake_host), tmp_path / "out")
    assert record.host_counts["orientations"] == 1


def test_simulated_attitude_wanders_about_the_truth(tmp_path: Path) -> None:
    simulate("room", tmp_path / "nine", duration=6.0, seed=3, orientation=True)
    simulate("room", tmp_path / "six", duration=6.0, seed=3)
    blocks = [
        [e for e in open_source(tmp_path / name).reader.raw_events() if isinstance(e, ImuBlock)]
        for name in ("nine", "six")
    ]
    assert all(block.orientation is None for block in blocks[1])
    # The attitude has a random stream of its own: everything else stays as it was.
    for nine, six in zip(*blocks, strict=True):
        assert np.array_equal(nine.accel, six.accel)
        assert np.array_equal(nine.gyro, six.gyro)
    given = Rotation.from_quat(np.concatenate([block.orientation for block in blocks[0]]))
    truth = Rotation.from_quat(read_tum(tmp_path / "nine" / "gt.tum").quaternions)
    heading, *tilt = (given * truth.inv()).as_euler("ZYX").T
    assert 0.0 < np.abs(tilt).max() < SIGMAS * AhrsErrors().tilt
    assert 0.0 < np.abs(heading).max() < SIGMAS * AhrsErrors().heading
    assert np.abs(np.diff(heading)).max() < 1e-4  # it wanders, it does not jump
