# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`./d2lio test --ros`: what it installs and builds, and what it says where it cannot."""

from __future__ import annotations

import pytest
from fake_checkout import Door


@pytest.fixture
def ros_door(door: Door) -> Door:
    """A checkout whose build of the nodes leaves the file that a shell sources."""
    setup = door.root / "build/ros/setup.bash"
    setup.parent.mkdir(parents=True)
    setup.write_text("export D2LIO_SOURCED=1\n")
    return door


def test_offline_without_ros_is_one_skipped_test_with_a_reason(door: Door) -> None:
    done = door.run("test", "--ros", D2LIO_OFFLINE="1")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "0 passed, 0 failed, 1 skipped (left out: ROS nodes: not installed)\n"
    assert "D2LIO_OFFLINE is set and ROS is not installed" in done.stderr
    assert "libroscpp-dev" in done.stderr
    counts = (door.root / "build/reports/ros/counts").read_text()
    assert counts.splitlines() == ["0 0 1", "ROS nodes: not installed"]
    assert door.calls() == []


def test_ros_is_installed_and_built_once(ros_door: Door) -> None:
    first = ros_door.run("test", "--ros")
    assert "[ros] system packages: catkin" in first.stderr
    assert "[ros] building the nodes" in first.stderr
    second = ros_door.run("test", "--ros")
    assert "[ros]" not in second.stderr


def test_a_change_of_a_node_builds_again(ros_door: Door) -> None:
    ros_door.run("test", "--ros")
    source = ros_door.root / "ros/d2lio_ros/src/node.cpp"
    source.parent.mkdir(parents=True, exist_ok=True)
    source.write_text("// two\n")
    assert "[ros] building the nodes" in ros_door.run("test", "--ros").stderr


def test_unknown_options_are_refused(door: Door) -> None:
    assert door.run("test", "--rosx").returncode == 2
