# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The fault table on a running node: what it does, and what it says."""

from __future__ import annotations

import csv
import json
import signal
import time
from pathlib import Path

import fault_bags
import numpy as np

SETTLE_S = 1.0


def run_node(ros, name, simulated, bag: Path, out: Path, rate=2.0, options="", **params):
    """Plays a bag to a FAST-LIO node: rows of diagnostics.csv, run.json, log."""
    settings = {"sequence_config": simulated.config, "queue_scans": 0} | params
    node = ros.node("d2lio_fastlio", name, save_dir=out, **settings)
    ros.play(bag, rate, options)
    time.sleep(SETTLE_S)
    assert node.poll() is None, "the node died\n" + ros.text(f"{name}.log")
    assert ros.end(node) == 0
    rows = list(csv.DictReader((out / "diagnostics.csv").open()))
    return rows, json.loads((out / "run.json").read_text()), ros.text(f"{name}.log")


def test_a_bag_that_loops_begins_a_new_epoch(ros, simulated, offline, tmp_path):
    first = simulated.messages
    shift = first[-1][1] - first[0][1] + 50_000_000  # ns; later by the recorder's clock
    looped = first + [(kind, stamp + shift, m) for kind, stamp, m in first]
    bag = simulated.faulty(tmp_path / "loop.bag", looped)
    rows, record, log = run_node(ros, "loop", simulated, bag, tmp_path / "out")
    assert "stamps jumped back" in log
    assert record["host_counts"]["epochs"] == 1
    assert sum(row["status"] == "reset" for row in rows) == 1
    # Both rounds are the offline run, each in a file of its own; the first lacks the scans that
    # were waiting for samples when the second began.
    expected = np.loadtxt(offline("fastlio") / "trajectory.tum")
    second = np.loadtxt(tmp_path / "out" / "trajectory.tum")
    np.testing.assert_allclose(second, expected, rtol=0.0, atol=1e-9)
    round_one = np.loadtxt(tmp_path / "out" / "trajectory.1.tum")
    assert len(expected) - 2 <= len(round_one) <= len(expected)
    np.testing.assert_allclose(round_one, expected[: len(round_one)], rtol=0.0, atol=1e-9)


def test_an_imu_gap_of_two_seconds_starts_anew(ros, simulated, tmp_path):
    messages = fault_bags.without_imu(simulated.messages, 3.0, 2.0)
    bag = simulated.faulty(tmp_path / "gap.bag", messages)
    rows, _, log = run_node(ros, "gap", simulated, bag, tmp_path / "out")
    assert "starting anew" in log
    resets = [row for row in rows if row["status"] == "reset"]
    assert len(resets) == 1
    assert resets[0]["message"].startswith("IMU gap of 1.")  # the first scan beyond the bound
    assert max(float(row["imu_gap_s"]) for row in rows) > 1.9
    assert rows[-1]["health"] == "OK"
    poses = np.loadtxt(tmp_path / "out" / "trajectory.tum")
    assert np.isfinite(poses).all()


def test_a_cloud_without_times_is_refused_with_advice(ros, simulated, tmp_path):
    messages = fault_bags.changed_clouds(fault_bags.read(simulated.bag), fault_bags.without_times)
    bag = simulated.faulty(tmp_path / "times.bag", messages)
    node_params = {
        "sequence_config": "",
        "lidar_topic": "/lidar/points",
        "imu_topic": "/imu/data",
    }
    with ros.recording("/times/diagnostics", tmp_path / "told.bag"):
        node = ros.node("d2lio_fastlio", "times", save_dir=tmp_path / "out", **node_params)
        ros.play(bag, 4.0)
    assert node.poll() is None
    assert ros.end(node) == 0
    assert "no per-point times" in ros.text("times.log")
    assert "pseudo_times" in ros.text("times.log")
    assert (tmp_path / "out" / "trajectory.tum").read_text() == ""
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "failed"
    assert record["scans"]["dropped"]["scans_bad_times"] == record["scans"]["read"]
    told = [m.status[0] for m in read_diagnostics(tmp_path / "told.bag")]
    assert any("no per-point times" in s.message and s.level > 0 for s in told)

    rows, _, _ = run_node(
        ros, "pseudo", simulated, bag, tmp_path / "pseudo", 4.0, lidar__pseudo_times="true",
        **node_params,
    )  # fmt: skip
    assert sum(row["status"] == "ok" for row in rows) > len(rows) - 5


def read_diagnostics(bag: Path) -> list:
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import get_types_from_msg

    out = []
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            fault_bags.STORE.register(
                get_types_from_msg(connection.msgdef.data, connection.msgtype)
            )
            out.append(fault_bags.STORE.deserialize_ros1(raw, connection.msgtype))
    return out


def test_a_burst_at_ten_times_the_rate_is_survived_without_loss(
    ros, simulated, offline, assert_same, tmp_path
):
    run_node(ros, "burst", simulated, simulated.bag, tmp_path / "out", rate=10.0)
    assert_same(tmp_path / "out", offline("fastlio"))


def test_overload_drops_the_oldest_scans_and_counts_them(ros, simulated, tmp_path):
    # Every point, tiny voxels, many iterations: much slower than the bag is played.
    rows, record, log = run_node(
        ros, "overload", simulated, simulated.bag, tmp_path / "out", rate=20.0, queue_scans=2,
        filter_size_surf=0.02, filter_size_map=0.02, max_iteration=50,
    )  # fmt: skip
    dropped = record["scans"]["dropped"]["scans_queue_full"]
    assert dropped > 0
    assert record["scans"]["read"] == len(rows) + dropped + record["scans"]["dropped"].get(
        "before_processing", 0
    )
    assert "cannot keep up" in log
    assert np.isfinite(np.loadtxt(tmp_path / "out" / "trajectory.tum", ndmin=2)).all()


def test_nan_points_and_empty_clouds_are_dropped_and_counted(ros, simulated, tmp_path):
    messages = fault_bags.changed_clouds(fault_bags.read(simulated.bag), fault_bags.with_nan)
    messages = fault_bags.changed_clouds(messages, fault_bags.emptied)
    bag = simulated.faulty(tmp_path / "nan.bag", messages)
    rows, record, log = run_node(ros, "nan", simulated, bag, tmp_path / "out")
    assert "holds no points" in log
    assert record["scans"]["dropped"]["scans_empty"] > 10
    assert record["host_counts"]["points_not_finite"] > 1000
    assert rows[-1]["health"] == "OK"


def test_topics_of_a_wrong_type_are_named(ros, simulated, tmp_path):
    node = ros.node("d2lio_fastlio", "swapped", lidar_topic="/imu/data", imu_topic="/lidar/points")
    ros.play(simulated.bag, 10.0)
    assert node.poll() is None
    assert ros.end(node) == 0
    log = ros.text("swapped.log")
    assert "/imu/data carries sensor_msgs/Imu, not a PointCloud2" in log
    assert "/lidar/points carries sensor_msgs/PointCloud2, not sensor_msgs/Imu" in log


def test_simulated_time_changes_nothing(ros, simulated, offline, assert_same, tmp_path):
    assert ros.run("rosparam set /use_sim_time true") == 0
    try:
        run_node(ros, "clock", simulated, simulated.bag, tmp_path / "out", options="--clock")
    finally:
        assert ros.run("rosparam set /use_sim_time false") == 0
    assert_same(tmp_path / "out", offline("fastlio"))


def test_a_killed_node_leaves_what_it_had(ros, simulated, offline, tmp_path):
    node = ros.node(
        "d2lio_fastlio", "killed", sequence_config=simulated.config, save_dir=tmp_path,
        queue_scans=0,
    )  # fmt: skip
    ros.play(simulated.bag, 4.0)
    time.sleep(SETTLE_S)
    ros.end(node, signal.SIGKILL)
    found = np.loadtxt(tmp_path / "trajectory.tum")
    expected = np.loadtxt(offline("fastlio") / "trajectory.tum")
    assert len(found) >= len(expected) - 1
    np.testing.assert_allclose(found, expected[: len(found)], rtol=0.0, atol=1e-9)
    rows = list(csv.DictReader((tmp_path / "diagnostics.csv").open()))
    assert rows[-1]["time_total_ms"]  # the last line is whole
