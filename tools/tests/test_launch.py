# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`./d2lio launch`: ROS and the nodes are set up, RViz where it is seen, and the verb handed on."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_checkout import Door

HEADLESS = ("launch", "compare", "a sequence", "--headless")
SEEN = ("launch", "compare", "a sequence")


@pytest.fixture
def ros_door(door: Door) -> Door:
    """A machine without ROS, where building the nodes leaves what the shell sources."""
    door.fake("id", "echo 0")
    build = 'mkdir -p "$4" && echo "export ROS_PACKAGE_PATH=sourced" >"$4/setup.bash"'
    door.fake("cmake", f'case "$1" in -S) {build} ;; esac')
    return door


def installed(door: Door) -> set[str]:
    return set(Path(door.environment["INSTALLED"]).read_text().split())


@pytest.mark.parametrize(("arguments", "rviz"), [(HEADLESS, False), (SEEN, True)])
def test_ros_is_installed_and_rviz_only_to_be_seen(
    ros_door: Door, arguments: tuple[str, ...], rviz: bool
) -> None:
    done = ros_door.run(*arguments)
    assert done.returncode == 0, done.stderr
    assert {"python3-roslaunch", "python3-rospy", "python3-numpy"} <= installed(ros_door)
    assert ("rviz" in installed(ros_door)) == rviz
    assert done.stdout == f"<{ros_door.cwd}>" + "".join(f"<{text}>" for text in arguments)


def test_the_second_call_starts_at_once(ros_door: Door) -> None:
    ros_door.run(*HEADLESS)
    ros_door.calls()
    second = ros_door.run(*HEADLESS)
    assert second.returncode == 0
    assert second.stderr == ""
    assert ros_door.calls() == []


def test_without_a_command_nothing_is_set_up(ros_door: Door) -> None:
    done = ros_door.run("launch")
    assert done.returncode == 2
    assert "compare SEQ" in done.stderr
    assert ros_door.calls() == []
