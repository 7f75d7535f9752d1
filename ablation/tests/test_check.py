# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`d2lio datasets`: bags in the layouts of the data sets, whole and with faults."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bags import CLOUD, NS, START, Recorded, cloud_message, drive, ros1_store, write_bag
from d2lio.cli import app
from d2lio.datasets import Scan, open_source, timed_events
from d2lio.datasets.check import Report, check_recording
from d2lio.datasets.recordings import find_recordings
from d2lio.metrics import read_tum
from known_bags import imu_stream, vlp16_cloud, write_known
from typer.testing import CliRunner

NAMES = {
    "alpha": "Offroad2_alpha",
    "beta": "Offroad2_beta",
    "gamma": "Offroad2_gamma",
    "rc2": "Hawkins_Long_Corridor",
    "ecmd": "Bridge_day_medium_b",
}
USAGE, DATA, INCOMPLETE = 2, 3, 4
LEVER_M = 0.4784  # of gamma to the prism, as published
TIME_F32_NS = 10


def check(path: Path, limit_s: float | None = None) -> Report:
    (recording,) = find_recordings(path)
    return check_recording(recording, limit_s)


def said(report: Report, level: str) -> str:
    return "\n".join(f"{f.what}: {f.text}" for f in report.findings if f.level == level)


def write_truth(folder: Path, kind: str, stamp: int = START) -> None:
    """Ground truth of 3 s in the form of the data set."""
    stamps = [stamp + i * NS // 5 for i in range(15)]
    if kind == "rc2":
        rows = ["timestamp[ns],p_w_b_x,p_w_b_y,p_w_b_z,qx,qy,qz,qw"]
        rows += [f"{s},{0.1 * i},0,0,0,0,0,1" for i, s in enumerate(stamps)]
        name = "ground_truth_path.csv"
    else:
        rows = [f"{s // NS}.{s % NS:09d} {0.1 * i} 0 0 0 0 0 1" for i, s in enumerate(stamps)]
        name = "gt.txt" if kind == "ecmd" else f"{NAMES[kind]}.txt"
    (folder / name).write_text("\n".join(rows) + "\n")


def known_bag(root: Path, kind: str, messages: list[Recorded] | None = None) -> Path:
    path = write_known(root / NAMES[kind] / f"{NAMES[kind]}.bag", kind, messages)
    write_truth(path.parent, kind, 1_517_157_100 * NS if kind == "rc2" else START)
    return path


CONVENTIONS = {
    "alpha": "in s from the scan's end",
    "beta": "in ns from the scan's start",
    "gamma": "in ns from the scan's start",
    "rc2": "in ns from the scan's start",
    "ecmd": "in s from the scan's start",
}


@pytest.mark.parametrize("kind", NAMES)
def test_whole_recordings_have_nothing_wrong(tmp_path: Path, kind: str) -> None:
    report = check(known_bag(tmp_path, kind))
    assert report.match is not None
    assert report.match.by == "name"
    assert report.match.device_name == {"ecmd": "car"}.get(kind, kind)
    assert said(report, "missing") == said(report, "wrong") == ""
    assert CONVENTIONS[kind] in said(report, "ok")
    assert "poses over" in said(report, "ok")
    assert report.verdict == "note"


@pytest.mark.parametrize("kind", NAMES)
def test_known_recordings_run_without_a_configuration(tmp_path: Path, kind: str) -> None:
    source = open_source(known_bag(tmp_path, kind))
    assert source.name.startswith(NAMES[kind])
    assert not np.array_equal(source.config.extrinsic, np.eye(4))
    scans = [e for e in timed_events(source.reader) if isinstance(e, Scan)]
    assert len(scans) == 20
    assert any("recognised as" in m for m in source.reader.notes.messages)
    spans = [float(scan.dt_ns.max()) for scan in scans]
    assert 0.09e9 < min(spans) <= max(spans) < 0.11e9


def test_alpha_begins_a_tenth_of_a_second_before_its_stamp(tmp_path: Path) -> None:
    source = open_source(known_bag(tmp_path, "alpha"))
    first = next(e for e in timed_events(source.reader) if isinstance(e, Scan))
    times = vlp16_cloud(0)["time"].astype(np.float64) * 1e9
    np.testing.assert_allclose(first.stamp - START + first.dt_ns, times, atol=TIME_F32_NS)
    assert "40." in said(check(tmp_path), "note") or "39." in said(check(tmp_path), "note")


def test_device_by_name_in_place_of_a_file(tmp_path: Path) -> None:
    path = write_known(tmp_path / "x.bag", "gamma")
    source = open_source(path, Path("geode/gamma"))
    assert source.config.imu.topic == "/imu/data"
    assert source.config.lidar.model == "avia"


def test_imu_in_g_is_known_noted_or_wrong(tmp_path: Path) -> None:
    report = check(known_bag(tmp_path / "a", "gamma"))
    assert "/livox/imu: accelerations in g (median 1.000)" in said(report, "ok")
    path = tmp_path / "b" / f"{NAMES['beta']}.bag"
    path.parent.mkdir()
    messages = drive(20)
    for message in messages:
        message.topic = {"/lidar/points": "/ouster/points"}.get(message.topic, message.topic)
    messages = [m for m in messages if m.topic != "/imu/data"]
    messages += imu_stream("/imu/data", 100, gravity=1.01)
    write_bag(path, sorted(messages, key=lambda m: m.log))
    assert "/imu/data: accelerations in g (median 1.010)" in said(check(path), "wrong")


def test_missing_topics_and_truth(tmp_path: Path) -> None:
    path = tmp_path / f"{NAMES['gamma']}.bag"
    write_bag(path, drive(5))
    report = check(path)
    assert "/livox/lidar: Livox Avia: no such topic" in said(report, "missing")
    assert "truth: no Offroad2_gamma.txt, Offroad2.txt" in said(report, "missing")
    assert report.verdict == "missing"


def test_wrong_type_of_a_topic(tmp_path: Path) -> None:
    path = tmp_path / f"{NAMES['gamma']}.bag"
    messages = [
        Recorded(
            m.log, {"/lidar/points": "/livox/lidar"}.get(m.topic, m.topic), m.msgtype, m.message
        )
        for m in drive(5)
    ]
    write_bag(path, messages)
    assert "is a sensor_msgs/msg/PointCloud2, not a livox" in said(check(path), "missing")


def test_rates_gaps_and_conventions_that_differ(tmp_path: Path) -> None:
    store = ros1_store()
    messages = imu_stream("/imu/data", 200)
    for i in [*range(8), *range(14, 20)]:
        stamp = START + i * NS // 10
        cloud = cloud_message(store, stamp, vlp16_cloud(i, begin=0.0))
        messages.append(Recorded(stamp, "/velodyne_points", CLOUD, cloud))
    path = tmp_path / f"{NAMES['alpha']}.bag"
    write_bag(path, sorted(messages, key=lambda m: m.log))
    wrong = said(check(path), "wrong")
    assert "/imu/data: 200.0 Hz instead of 100 Hz" in wrong
    assert "/velodyne_points: 1 gaps, the longest 0.70 s" in wrong
    assert "count from the scan's start (stamp), known is the scan's end (stamp)" in wrong


def test_points_without_times(tmp_path: Path) -> None:
    store = ros1_store()
    messages = imu_stream("/imu/data", 400)
    for i in range(20):
        stamp = START + i * NS // 10
        fields = ("x", "y", "z", "intensity")
        cloud = cloud_message(store, stamp, vlp16_cloud(i), fields=fields)
        messages.append(Recorded(stamp, "/velodyne_points", CLOUD, cloud))
    path = tmp_path / f"{NAMES['ecmd']}.bag"
    write_bag(path, sorted(messages, key=lambda m: m.log))
    assert "the points have no time field" in said(check(path), "missing")


def test_clocks(tmp_path: Path) -> None:
    report = check(known_bag(tmp_path / "a", "rc2"))
    assert "header stamps lie -173097000.1 s from the recorder's clock" in said(report, "note")
    path = write_bag(tmp_path / "apart.bag", drive(20, imu_clock=60 * NS))
    assert "/imu/data and the LiDAR are +60.1 s apart" in said(check(path), "wrong")


def test_only_the_beginning_is_read_unless_asked(tmp_path: Path) -> None:
    path = known_bag(tmp_path, "alpha")
    some, everything = check(path, 0.55), check(path, None)
    assert some.measured is not None
    assert everything.measured is not None
    assert some.measured.lidar is not None
    assert everything.measured.lidar is not None
    assert len(some.measured.lidar) == 4
    assert len(everything.measured.lidar) == 20
    assert some.duration_s == everything.duration_s


def test_truth_of_another_day(tmp_path: Path) -> None:
    path = known_bag(tmp_path, "alpha")
    write_truth(path.parent, "alpha", START + 86_400 * NS)
    assert "15 poses over 0.0 s of the recording" in said(check(path), "wrong")


def test_shards_are_one_recording_and_sequences_are_not(tmp_path: Path) -> None:
    for name in ("raw_data_core_0", "raw_data_core_1", "bridge01", "bridge02"):
        write_bag(tmp_path / f"{name}.bag", drive(2))
    found = [[f.name for f in r.files] for r in find_recordings(tmp_path)]
    shards = ["raw_data_core_0.bag", "raw_data_core_1.bag"]
    assert sorted(found) == [["bridge01.bag"], ["bridge02.bag"], shards]


def run(*arguments: object):
    return CliRunner().invoke(app, ["datasets", *map(str, arguments)])


def test_a_damaged_bag_is_a_row(tmp_path: Path) -> None:
    good = known_bag(tmp_path, "beta")
    broken = tmp_path / f"{NAMES['alpha']}.bag"
    broken.write_bytes(good.read_bytes()[:-3000])
    empty = tmp_path / "Offroad3_alpha.bag"
    empty.touch()
    middle = bytearray(good.read_bytes())
    at = middle.index(b"lidar", len(middle) // 2)
    middle[at - 8 : at + 4] = b"\xff" * 12
    (tmp_path / "Offroad4_beta.bag").write_bytes(middle)
    done = run("check", tmp_path, "--json")
    assert done.exit_code == INCOMPLETE
    rows = {row["recognised"]: row for row in json.loads(done.stdout)}
    assert rows["geode/beta Offroad2_beta"]["verdict"] == "note"
    for name in ("alpha Offroad2_alpha", "alpha Offroad3_alpha", "beta Offroad4_beta"):
        found = rows[f"geode/{name}"]["findings"]
        assert any(f["what"] == "file" and f["level"] == "wrong" for f in found)


def test_tables_and_exit_codes(tmp_path: Path) -> None:
    known_bag(tmp_path, "gamma")
    done = run("check", tmp_path)
    assert done.exit_code == 0, done.output
    assert "geode/gamma Offroad2_gamma" in done.stdout
    assert "/livox/lidar 10.0 Hz" in done.stdout
    assert run("check", tmp_path / "absent").exit_code == DATA
    (tmp_path / "none").mkdir()
    assert run("check", tmp_path / "none").exit_code == INCOMPLETE


def test_list(tmp_path: Path) -> None:
    rows = json.loads(run("list", "--json").stdout)
    assert len([r for r in rows if r["dataset"] == "geode"]) == 64
    by_name = {r["name"]: r for r in rows}
    assert by_name["Offroad2_beta"]["sensor"] == "Ouster OS1-64"
    assert by_name["Offroad2_beta"]["length_m"] == 680.39
    tables = {r["name"]: r["tables"] for r in json.loads(run("list", "--paper", "--json").stdout)}
    assert tables["Bridge_day_medium_b"] == "1 2"
    assert all(tables.values())
    assert "Final_Challenge_UGV1" in run("list", "subt_mrs").stdout
    assert run("list", "kitti").exit_code == DATA


def test_truth_written_for_the_evaluation(tmp_path: Path) -> None:
    bag = known_bag(tmp_path, "rc2")
    out = tmp_path / "gt.tum"
    done = run("truth", bag, "--out", out)
    assert done.exit_code == 0, done.output
    assert read_tum(out).stamps[0] == 1_517_157_100 * NS
    assert run("truth", tmp_path / "unknown.bag", "--out", out).exit_code == DATA


def test_configuration_of_a_device_can_be_run(tmp_path: Path) -> None:
    done = run("config", "geode/alpha")
    assert done.exit_code == 0
    file = tmp_path / "alpha.yaml"
    file.write_text(done.stdout)
    bag = write_known(tmp_path / "x.bag", "alpha")
    source, named = open_source(bag, file), open_source(bag, Path("geode/alpha"))
    np.testing.assert_array_equal(source.config.extrinsic, named.config.extrinsic)
    assert source.config.lidar == named.config.lidar


def test_real_recordings_of_no_known_data_set(real_data) -> None:
    report = check(real_data("pointcloudset_ouster_mcap/test.mcap"))
    assert "different clocks" in said(report, "wrong")
    assert "in ns from the scan's start" in said(report, "ok")
    report = check(real_data("ouster_sdk_tests/512x10_raw.bag"))
    assert "no topic of a type that can be read" in said(report, "missing")


def test_estimate_moved_to_position_only_truth(tmp_path: Path) -> None:
    bag = tmp_path / "Tunneling_tunnel2_gamma.bag"
    bag.touch()
    prism = [f"{i} {0.1 * i} 0 0 0 0 0 0" for i in range(15)]
    (tmp_path / "Tunneling_tunnel2.txt").write_text("\n".join(prism) + "\n")
    estimate, moved, out = (tmp_path / name for name in ("e.tum", "m.tum", "gt.tum"))
    estimate.write_text("".join(f"{i} {0.1 * i} 0 0 0 0 0 1\n" for i in range(15)))
    done = run("truth", bag, "--out", out, "--estimate", estimate, "--moved", moved)
    assert done.exit_code == 0, done.output
    assert "the estimate must be moved" in " ".join(done.stderr.split())
    assert read_tum(out).position_only
    lever = read_tum(moved).positions - read_tum(estimate).positions
    np.testing.assert_allclose(np.linalg.norm(lever, axis=1), LEVER_M, atol=1e-3)
    assert run("truth", bag, "--out", out, "--estimate", estimate).exit_code == USAGE
