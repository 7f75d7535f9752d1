# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the tests that need ROS: one master, one simulated sequence, offline runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import fault_bags
import numpy as np
import pytest
import ros_harness

DURATION_S = 6.0
IMU_TOPIC, LIDAR_TOPIC = "/imu/data", "/lidar/points"
TOPICS = {fault_bags.CLOUD: LIDAR_TOPIC, fault_bags.IMU: IMU_TOPIC}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if not ros_harness.SETUP:
        reason = "ROS is not built here: run ./d2lio test --ros"
        for item in items:
            if "ros" in item.path.parts:
                item.add_marker(pytest.mark.skip(reason=reason))


@dataclass(frozen=True)
class Simulated:
    """A simulated sequence and its messages."""

    folder: Path
    messages: list[fault_bags.Message]

    @property
    def bag(self) -> Path:
        return self.folder / "data.bag"

    @property
    def config(self) -> Path:
        return self.folder / "sequence.yaml"

    def faulty(self, bag: Path, messages: list[fault_bags.Message]) -> Path:
        return fault_bags.write(bag, messages, TOPICS)


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    from d2lio.simulator.pipeline import simulate

    folder = tmp_path_factory.mktemp("sequence") / "room"
    simulate("room", folder, duration=DURATION_S)
    return Simulated(folder, fault_bags.read(folder / "data.bag"))


@pytest.fixture(scope="session")
def offline(
    simulated: Simulated, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str, Path | None], Path]:
    """Runs a host over a bag as `d2lio run` does; the folder of the results."""
    from d2lio.datasets import open_source
    from d2lio.runner import RunOptions, run

    done: dict[tuple[str, Path], Path] = {}

    def run_host(host: str, sequence: Path | None = None) -> Path:
        key = (host, sequence or simulated.folder)
        if key not in done:
            out = tmp_path_factory.mktemp("offline") / "run"
            run(open_source(key[1]), RunOptions(host=host), out)
            done[key] = out
        return done[key]

    return run_host


@pytest.fixture(scope="session")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ros_harness.Ros]:
    ros = ros_harness.Ros(tmp_path_factory.mktemp("ros"))
    try:
        ros.start_master()
        yield ros
    finally:
        ros.end_all()


def trajectory(folder: Path, name: str = "trajectory.tum") -> np.ndarray:
    """Stamps and poses, [N, 8]."""
    return np.loadtxt(folder / name, ndmin=2)


@pytest.fixture
def assert_same() -> Callable[[Path, Path], None]:
    """Asserts that two runs have the same stamps and the same poses to 1e-9."""

    def check(run: Path, expected: Path) -> None:
        found, wanted = trajectory(run), trajectory(expected)
        assert found.shape == wanted.shape
        assert np.array_equal(found[:, 0], wanted[:, 0])
        np.testing.assert_allclose(found[:, 1:], wanted[:, 1:], rtol=0.0, atol=1e-9)

    return check
