# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The rostest of both nodes, and the launch files."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = ("fastlio_plugin/ros/config", "liosam_plugin/ros/config")


def test_both_nodes_under_rostest(ros, simulated, offline):
    arguments = f"sequence:={simulated.folder} " + " ".join(
        f"{host}:={offline(host)}/trajectory.tum" for host in ("fastlio", "liosam")
    )
    code = ros.run(f"rostest --text d2lio_ros both_nodes.test {arguments}", "rostest.log", 120.0)
    log = ros.text("rostest.log")
    assert code == 0, log
    assert "RESULT: SUCCESS" in log


@pytest.mark.parametrize("package", ["d2lio_fastlio", "d2lio_liosam"])
def test_odometry_launch_plays_a_bag_and_saves(package, ros, simulated, tmp_path):
    arguments = (
        f"rviz:=false sequence_config:={simulated.config} bag:={simulated.bag} rate:=4"
        f" save_dir:={tmp_path} queue_scans:=0"
    )
    launch = ros.spawn(f"roslaunch {package} odometry.launch {arguments}", "launch.log")
    end = time.monotonic() + 40.0
    while "[player-" not in ros.text("launch.log") or "finished cleanly" not in ros.text(
        "launch.log"
    ):
        assert launch.poll() is None, ros.text("launch.log")
        assert time.monotonic() < end, ros.text("launch.log")
        time.sleep(0.2)
    ros.end(launch)
    assert len(np.loadtxt(tmp_path / "trajectory.tum")) > 20
    assert (tmp_path / "map.pcd").stat().st_size > 1000


@pytest.mark.parametrize("config", ["velodyne", "velodyne_packets", "ouster", "livox", "generic"])
def test_every_sensor_configuration_starts(config, ros):
    launch = ros.spawn(
        f"roslaunch d2lio_fastlio odometry.launch rviz:=false config:={config} ns:={config}",
        "config.log",
    )
    ros.wait_for("config.log", "listens to")
    assert "wrong parameters" not in ros.text("config.log")
    ros.end(launch)
    texts = [(ROOT / plugin / f"{config}.yaml").read_text() for plugin in CONFIGS]
    assert texts[0] == texts[1]  # the sensors are the same for both
