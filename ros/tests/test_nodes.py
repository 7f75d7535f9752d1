# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nodes on a simulated bag: the offline trajectory, every output, every service."""

from __future__ import annotations

import csv
import signal
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore

HOSTS = {"fastlio": "d2lio_fastlio", "liosam": "d2lio_liosam", "d2lio": "d2lio_liosam"}
EXTRA_KEYS = {"latency_ms", "queue", "dropped"}
SETTLE_S = 1.0  # for the last messages on their way


@pytest.mark.parametrize("host", list(HOSTS))
def test_node_repeats_the_offline_run(host, ros, simulated, offline, assert_same, tmp_path):
    extra = {} if host == "fastlio" else {"estimator": host}
    node = ros.node(
        HOSTS[host],
        f"same_{host}",
        sequence_config=simulated.config,
        save_dir=tmp_path,
        queue_scans=0,
        **extra,
    )
    ros.play(simulated.bag, rate=2.0)
    time.sleep(SETTLE_S)
    assert ros.end(node) == 0
    expected = offline(host)
    assert_same(tmp_path, expected)
    rows = list(csv.DictReader((tmp_path / "diagnostics.csv").open()))
    wanted = list(csv.DictReader((expected / "diagnostics.csv").open()))
    assert list(rows[0]) == list(wanted[0])
    assert len(rows) == len(wanted)
    for row, other in zip(rows, wanted, strict=True):
        assert [v for k, v in row.items() if not k.startswith("time_")] == [
            v for k, v in other.items() if not k.startswith("time_")
        ]


@pytest.fixture(scope="module")
def recorded(ros, simulated, tmp_path_factory):
    """A run with all topics recorded: (folder of the node, messages by topic)."""
    folder = tmp_path_factory.mktemp("recorded")
    node = ros.node(
        "d2lio_fastlio",
        "out",
        sequence_config=simulated.config,
        save_dir=folder / "saved",
        queue_scans=0,
        map_period=1.0,
    )
    topics = " ".join(
        f"/out/{t}"
        for t in ("odometry", "path", "cloud_registered", "map", "diagnostics", "markers")
    )
    with ros.recording(f"{topics} /tf /diagnostics", folder / "out.bag"):
        ros.play(simulated.bag)
        time.sleep(SETTLE_S)
    assert ros.end(node, signal.SIGTERM) == 0
    store = get_typestore(Stores.ROS1_NOETIC)
    messages: dict[str, list] = {}
    with Reader(folder / "out.bag") as reader:
        for connection, _, raw in reader.messages():
            if connection.msgtype not in store.types:
                from rosbags.typesys import get_types_from_msg

                store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            message = store.deserialize_ros1(raw, connection.msgtype)
            messages.setdefault(connection.topic, []).append(message)
    return folder / "saved", messages


def stamp_of(message) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def test_odometry_is_the_saved_trajectory(recorded):
    saved, messages = recorded
    rows = np.loadtxt(saved / "trajectory.tum")
    odometry = messages["/out/odometry"]
    # The last scan is completed by the node's end, when nobody listens any more.
    assert len(rows) - 1 <= len(odometry) <= len(rows)
    for message, row in zip(odometry, rows, strict=False):
        p = message.pose.pose.position
        assert stamp_of(message) == pytest.approx(row[0], abs=1e-6)
        assert [p.x, p.y, p.z] == list(row[1:4])
        assert message.header.frame_id == "map"
        assert message.child_frame_id == "imu"
        covariance = message.pose.covariance.reshape(6, 6)
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-15)
        assert (np.diag(covariance) > 0).all()


def test_every_scan_has_one_status_with_the_columns_of_the_file(recorded):
    saved, messages = recorded
    rows = list(csv.DictReader((saved / "diagnostics.csv").open()))
    scans = [
        m.status[0] for m in messages["/out/diagnostics"] if m.status[0].name.endswith(": scan")
    ]
    assert len(rows) - 1 <= len(scans) <= len(rows)
    for status, row in zip(scans, rows, strict=False):
        values = {v.key: v.value for v in status.values}
        assert set(values) == set(row) | EXTRA_KEYS
        assert {k: values[k] for k in row} == row
        assert 0.0 < float(values["latency_ms"]) < 5000.0
        assert values["dropped"] == "0"
    names = Counter(m.status[0].name for m in messages["/diagnostics"])
    assert names["/out/odometry_node: scan"] >= len(rows) - 1


def test_path_map_clouds_transforms_and_markers_are_published(recorded):
    saved, messages = recorded
    poses = len(np.loadtxt(saved / "trajectory.tum"))
    path = messages["/out/path"][-1]
    assert poses / 2 < len(path.poses) <= poses
    assert messages["/out/map"][-1].width > 1000
    clouds = messages["/out/cloud_registered"]
    assert len(clouds) >= poses - 2
    assert [f.name for f in clouds[-1].fields] == ["x", "y", "z", "intensity"]
    transforms = [t for m in messages["/tf"] for t in m.transforms if t.child_frame_id == "imu"]
    assert len(transforms) >= poses - 1
    spaces = {m.ns for m in messages["/out/markers"][-1].markers}
    assert spaces == {"weak_translation", "weak_rotation", "information", "health"}


def test_registered_cloud_lies_on_the_map(recorded):
    _, messages = recorded

    def points(cloud):
        step = cloud.point_step
        data = np.array(cloud.data).reshape(-1, step)[:, :12]
        return np.ascontiguousarray(data).view(np.float32)

    from scipy.spatial import cKDTree

    tree = cKDTree(points(messages["/out/map"][-1]))
    distance, _ = tree.query(points(messages["/out/cloud_registered"][-1])[::50])
    assert np.median(distance) < 0.3  # the map's voxels are 0.5 m wide


def call(ros, service: str, arguments: str = "") -> str:
    log = f"call_{service.replace('/', '_')}.log"
    assert ros.run(f"rosservice call {service} {arguments}", log) == 0, ros.text(log)
    return ros.text(log)


def test_services_save_reset_and_change_the_mode(ros, simulated, tmp_path):
    node = ros.node("d2lio_fastlio", "serve", sequence_config=simulated.config, queue_scans=0)
    ros.play(simulated.bag, rate=4.0)
    prefix = "/serve/odometry_node"
    assert "success: True" in call(ros, f"{prefix}/save_map", str(tmp_path / "map.pcd"))
    header, _, data = (tmp_path / "map.pcd").read_bytes().partition(b"DATA binary\n")
    count = int(header.split(b"POINTS ")[1].split()[0])
    assert count > 1000
    assert len(data) == 12 * count
    tum = tmp_path / "now.tum"
    assert "success: True" in call(ros, f"{prefix}/save_trajectory", str(tum))
    assert len(np.loadtxt(tum)) > 10
    assert "no save_dir" in call(ros, f"{prefix}/save_map", "''")
    assert "success: True" in call(ros, f"{prefix}/set_mode", "kiss remap")
    refused = call(ros, f"{prefix}/set_mode", "kis ''")
    assert "success: False" in refused
    assert "point_adaptive" in refused
    assert "success: True" in call(ros, f"{prefix}/publish_map")
    assert "success: True" in call(ros, f"{prefix}/reset")
    assert ros.end(node) == 0


def test_every_wrong_parameter_is_told_at_once(ros, simulated):
    process = ros.spawn(
        "rosrun d2lio_fastlio d2lio_fastlio __name:=wrong _imu_topic:=/imu _lidar_topic:=/points"
        " _filter_size_surf:=-1 _rejection/mod:=kiss _rejection/mode:=kis _threads:=0"
        " _quee_scans:=3 _T_imu_lidar:='[2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]'",
        "wrong.log",
    )
    assert process.wait(20) == 1
    log = ros.text("wrong.log")
    for needle in (
        "~filter_size_surf = -1",
        "~rejection/mod = kiss: unknown key; did you mean ~rejection/mode",
        "~rejection/mode = kis: allowed: ",
        "~threads = 0: allowed: ",
        "~quee_scans = 3: unknown key; did you mean ~queue_scans",
        "~mapping/extrinsic_R",
        "determinant",
    ):
        assert needle in log, f"no '{needle}' in\n{log}"
    assert log.count("cannot start") == 1


def test_missing_topics_and_files_are_told(ros, tmp_path: Path):
    process = ros.spawn(
        "rosrun d2lio_fastlio d2lio_fastlio __name:=missing"
        f" _sequence_config:={tmp_path}/none.yaml",
        "missing.log",
    )
    assert process.wait(20) == 1
    log = ros.text("missing.log")
    assert "none.yaml: cannot be read" in log
    assert "~lidar_topic" in log
    assert "~imu_topic" in log
