# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The parts of ros/d2lio_compare that need no ROS."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from d2lio.compare.shared import names
from d2lio.simulator.pipeline import extrinsic
from scipy.spatial.transform import Rotation

SOURCE = Path(__file__).resolve().parents[3] / "ros" / "d2lio_compare" / "src"
sys.path.insert(0, str(SOURCE))

from d2lio_compare import feed, launch_file, poses, rviz_file  # noqa: E402

SENSOR = {"model": "vlp16", "rings": 16, "time_unit": "s", "min_range_m": 0.5}
EXACT = 1e-12


def setting(**changes: object) -> launch_file.Setting:
    known = {"T_imu_lidar": extrinsic().tolist(), "lidar": SENSOR}
    values = {
        "out": "/out", "config": "/seq/sequence.yaml", "description": known,
        "truth_file": "/seq/gt.tum", "truth_topic": "", "lidar_topic": "/points",
        "imu_topic": "/imu", "lidar_type": "auto", "threads": 1, "queue_scans": 0, "sim_time": True,
    }  # fmt: skip
    return launch_file.Setting(**(values | changes))


def launched(text: str, **changes: object) -> ElementTree.Element:
    return ElementTree.fromstring(launch_file.write(names.parse(text), setting(**changes)))


def params(element: ElementTree.Element) -> dict[str, str]:
    return {each.get("name", ""): each.get("value", "") for each in element.findall("param")}


def test_the_shared_folder_is_the_packages() -> None:
    for file in Path(names.__file__).parent.glob("*.py"):
        linked = SOURCE / "d2lio_compare" / "shared" / file.name
        assert linked.read_bytes() == file.read_bytes()


def test_every_variant_is_a_node_in_its_namespace() -> None:
    root = launched("off,d2,liosam:d2,d2lio:off")
    groups = {group.get("ns"): group.find("node") for group in root.findall("group")}
    assert list(groups) == ["off", "d2", "liosam_d2", "d2lio_off"]
    full = params(groups["d2"])
    assert full["rejection/mode"] == "point_adaptive"
    assert full["degeneracy/method"] == names.DEFAULT_DEGENERACY
    assert (full["save_dir"], full["results_name"]) == ("/out/nodes", "d2")
    assert groups["liosam_d2"].get("pkg") == groups["d2lio_off"].get("pkg") == "d2lio_liosam"
    assert params(groups["d2lio_off"])["estimator"] == "d2lio"
    assert not any(node.get("required") for node in root.iter("node"))  # one's end is its own
    assert {node.get("clear_params") for node in root.iter("node")} == {"true"}


def test_the_scoreboard_is_told_of_all_variants() -> None:
    node = launched("off,d2").find("node")
    told = yaml.safe_load(node.find("rosparam").text)
    assert [names.Variant(**entry) for entry in told] == names.parse("off,d2")


def test_topics_that_are_not_known_are_left_to_the_node() -> None:
    node = launched("off", lidar_topic="", imu_topic="", config="").find("group/node")
    assert not {"lidar_topic", "imu_topic", "sequence_config"} & set(params(node))


def test_upstream_is_told_of_the_sensor() -> None:
    group = launched("upstream:fast_lio").find("group")
    told = {each.get("param"): yaml.safe_load(each.text) for each in group.findall("rosparam")}
    assert told["common/lid_topic"] == "/points"
    assert (told["preprocess/scan_line"], told["preprocess/timestamp_unit"]) == (16, 0)
    assert told["mapping/extrinsic_T"] == extrinsic()[:3, 3].tolist()
    assert told["pcd_save/pcd_save_en"] is False
    remaps = {each.get("from"): each.get("to") for each in group.findall("remap")}
    assert remaps["/Odometry"] == "odometry"
    order = [each.tag for each in group]
    assert order.index("include") < order.index("rosparam")  # the last value of a name counts


def test_lio_sam_gets_the_imu_in_the_frame_of_the_lidar() -> None:
    group = launched("upstream:lio_sam").find("group")
    told = {
        each.get("param"): yaml.safe_load(each.text)
        for each in group.findall("rosparam")
        if each.get("param")
    }
    inverse = np.linalg.inv(extrinsic())
    assert told["lio_sam/extrinsicTrans"] == pytest.approx(inverse[:3, 3], abs=EXACT)
    assert np.reshape(told["lio_sam/extrinsicRot"], (3, 3)) == pytest.approx(
        inverse[:3, :3], abs=EXACT
    )


def test_rviz_shows_every_variant_in_its_colour() -> None:
    variants = names.parse("off,d2,liosam:d2")
    layout = yaml.safe_load(rviz_file.write(variants))
    displays = layout["Visualization Manager"]["Displays"]
    groups = {d["Name"]: d["Displays"] for d in displays if d["Class"] == "rviz/Group"}
    for variant in variants:
        colour = "; ".join(str(part) for part in names.rgb(variant.colour))
        path, cloud, markers, rejected = groups[variant.title]
        assert path["Color"] == cloud["Color"] == colour
        topics = [path["Topic"], cloud["Topic"], markers["Marker Topic"], rejected["Topic"]]
        assert all(topic.startswith(f"/{variant.id}/") for topic in topics)


def test_quaternions_are_those_of_scipy() -> None:
    for rotation in Rotation.random(50, random_state=3):
        assert poses.matrix(rotation.as_quat()) == pytest.approx(rotation.as_matrix(), abs=EXACT)
        expected = rotation.as_quat(canonical=True)
        assert poses.quaternion_of(rotation.as_matrix()) == pytest.approx(expected, abs=1e-9)


def test_tum_files_keep_every_nanosecond(tmp_path: Path) -> None:
    stamp, place = 1_700_000_000_123_456_789, np.array([0.1, -2.0, 1e-7])
    quaternion = np.array([0.0, 0.6, 0.0, 0.8])
    file = tmp_path / "one.tum"
    file.write_text("# comment\n" + poses.tum_line(stamp, place, quaternion), encoding="utf-8")
    read = poses.read_tum(str(file))
    assert (read.stamps.tolist(), read.positions.tolist()) == ([stamp], [place.tolist()])
    assert read.quaternions.tolist() == [quaternion.tolist()]


def one_feed(folder: str = "", lidar: np.ndarray | None = None) -> feed.Feed:
    stamps = np.arange(0, 100) * 100_000_000
    places = np.stack([np.sin(stamps * 1e-9), stamps * 1e-9, np.zeros(100)], axis=1)
    truth = poses.Truth(stamps, places, np.zeros((100, 4)))
    return feed.Feed(names.parse("upstream:lio_sam")[0], truth, folder, lidar)


IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def test_stamps_that_jump_back_begin_a_new_trajectory() -> None:
    one = one_feed()
    for stamp in (1, 2, 3, 4, 1):
        one.add_pose(stamp * 100_000_000, np.zeros(3), IDENTITY)
    assert (one.epochs, len(one.ape)) == (2, 1)


def test_odometry_of_the_lidar_becomes_that_of_the_imu(tmp_path: Path) -> None:
    one = one_feed(str(tmp_path), extrinsic())
    T_map_imu = np.eye(4)
    T_map_imu[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.2, 1.0]).as_matrix()
    T_map_imu[:3, 3] = [4.0, -1.0, 0.5]
    T_map_lidar = T_map_imu @ extrinsic()
    one.add_pose(100, T_map_lidar[:3, 3], Rotation.from_matrix(T_map_lidar[:3, :3]).as_quat())
    one.close()
    read = poses.read_tum(str(tmp_path / "trajectory.tum"))
    assert read.positions[0] == pytest.approx(T_map_imu[:3, 3], abs=EXACT)
    assert poses.matrix(read.quaternions[0]) == pytest.approx(T_map_imu[:3, :3], abs=1e-9)


def test_statuses_of_other_kinds_are_passed_over_and_rows_saved(tmp_path: Path) -> None:
    one = one_feed(str(tmp_path))
    one.add_status(5, 0, {"imu_accepted": "7"})
    one.add_status(5, 1, {"lambda_t_1": "3.5", "offered": "10", "accepted": "5"})
    one.close()
    with (tmp_path / "diagnostics.csv").open(newline="", encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["stamp_ns"], row["health"], row["lambda_t_1"]) == ("5", "DEGENERATE", "3.5")
    line = one.line()
    assert (line.scans, line.lambda_min, line.rejected) == (1, 3.5, 0.5)


def test_a_variant_is_done_when_nothing_waits_and_nothing_comes() -> None:
    one = one_feed()
    assert not one.quiet(60.0)
    assert one.quiet(0.0)
    one.add_status(5, 0, {"lambda_t_1": "1.0", "queue": "2"})
    assert not one.quiet(0.0)
    one.dead = True
    assert one.quiet(60.0)
