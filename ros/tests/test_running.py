# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What a running estimator lets one do and see: another mode, rejected points."""

from __future__ import annotations

import csv
import math
import time

import fault_bags
import numpy as np
import pytest
from rosbags.rosbag1 import Reader


@pytest.mark.parametrize("package", ["d2lio_fastlio", "d2lio_liosam"])
def test_mode_changes_between_scans_and_the_estimate_goes_on(package, ros, simulated, tmp_path):
    name = f"running_{package}"
    node = ros.node(
        package, name, sequence_config=simulated.config, save_dir=tmp_path, queue_scans=0
    )
    player = ros.spawn(f"rosbag play -q --queue=10000 -d 0.7 {simulated.bag}", "slow.log")
    time.sleep(3.5)
    service = f"rosservice call /{name}/odometry_node/set_mode kiss paper"
    assert ros.run(service, "mode.log") == 0
    assert "the estimate goes on" in ros.text("mode.log")
    assert player.wait(30) == 0
    time.sleep(1.0)
    assert ros.end(node) == 0
    rows = list(csv.DictReader((tmp_path / "diagnostics.csv").open()))
    rows = [row for row in rows if row["status"] == "ok"]
    kiss = [not math.isnan(float(row["sigma"])) for row in rows]
    assert not kiss[0]
    assert kiss[-1]
    assert kiss == sorted(kiss)
    assert float(rows[-1]["prior_t_1"]) > 0.0
    assert len(np.loadtxt(tmp_path / "trajectory.tum")) >= len(rows)
    assert not (tmp_path / "trajectory.1.tum").exists()


def test_rejected_points_are_those_that_the_diagnostics_count(ros, simulated, tmp_path):
    node = ros.node(
        "d2lio_fastlio", "rejected", sequence_config=simulated.config, save_dir=tmp_path,
        queue_scans=0, rejection__mode="fixed", rejection__tau=0.2,
    )  # fmt: skip
    with ros.recording("/rejected/rejected", tmp_path / "rejected.bag"):
        ros.play(simulated.bag)
        time.sleep(1.0)
    assert ros.end(node) == 0
    rows = csv.DictReader((tmp_path / "diagnostics.csv").open())
    counts = {int(r["stamp_ns"]): int(r["offered"]) - int(r["accepted"]) for r in rows}
    seen = 0
    with Reader(tmp_path / "rejected.bag") as reader:
        for connection, _, raw in reader.messages():
            cloud = fault_bags.STORE.deserialize_ros1(raw, connection.msgtype)
            stamp = cloud.header.stamp.sec * fault_bags.NS + cloud.header.stamp.nanosec
            assert cloud.width == counts[stamp]
            seen += cloud.width
    assert seen > 100
