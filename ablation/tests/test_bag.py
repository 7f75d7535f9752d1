# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Bags: topics, order, clocks, damage, and the real recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bags import CLOUD, IMU, NS, START, Recorded, drive, imu_message, ros1_store, write_bag
from d2lio.datasets import ImuBlock, RawScan, SourceConfig, open_source
from d2lio.datasets.bag import BagReader
from d2lio.errors import ConfigError, DataError
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore


def read(path: Path, **config: object) -> tuple[list, BagReader]:
    reader = BagReader(path, SourceConfig.parse(config))
    return list(reader.raw_events()), reader


def scans_of(events: list) -> list[RawScan]:
    return [event for event in events if isinstance(event, RawScan)]


def imu_stamps(events: list) -> np.ndarray:
    return np.concatenate([event.stamps for event in events if isinstance(event, ImuBlock)])


def test_all_samples_and_scans_in_order(tmp_path: Path) -> None:
    events, reader = read(write_bag(tmp_path / "a.bag", drive(5)))
    stamps = [scan.stamp for scan in scans_of(events)]
    assert stamps == [START + i * NS // 10 for i in range(5)]
    assert np.all(np.diff(imu_stamps(events)) == NS // 100)
    assert reader.scan_total == 5
    assert reader.notes.counts == {"imu_read": 90, "scans_read": 5}
    assert reader.inputs == ["a.bag"]


def test_imu_values_and_units(tmp_path: Path) -> None:
    store = ros1_store()
    messages = drive(1)
    sample = imu_message(store, START + NS, gyro=(1.0, 2.0, 3.0), accel=(0.0, 0.5, 1.0))
    messages.append(Recorded(START + NS, "/imu/data", IMU, sample))
    path = write_bag(tmp_path / "a.bag", messages)
    last = [e for e in read(path)[0] if isinstance(e, ImuBlock)][-1]
    assert last.gyro[-1].tolist() == [1.0, 2.0, 3.0]
    assert last.accel[-1].tolist() == [0.0, 0.5, 1.0]
    in_g = [e for e in read(path, imu={"accel_unit": "g"})[0] if isinstance(e, ImuBlock)][-1]
    assert in_g.accel[-1].tolist() == [0.0, 4.903325, 9.80665]


def test_shards_of_a_directory_are_one_recording(tmp_path: Path) -> None:
    messages = drive(6)
    half = len(messages) // 2
    write_bag(tmp_path / "b_0.bag", messages[:half])
    write_bag(tmp_path / "b_1.bag", messages[half:])
    events, reader = read(tmp_path)
    assert len(scans_of(events)) == 6
    assert reader.inputs == ["b_0.bag", "b_1.bag"]


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_ros2_bags(tmp_path: Path, plugin: StoragePlugin) -> None:
    source = write_bag(tmp_path / "a.bag", drive(3))
    target = tmp_path / "ros2"
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(target, version=9, storage_plugin=plugin) as out:
        links = {
            topic: out.add_connection(topic, msgtype, typestore=store)
            for topic, msgtype in (("/imu/data", IMU), ("/lidar/points", CLOUD))
        }
        for item in drive(3, store=store):
            raw = store.serialize_cdr(item.message, item.msgtype)
            out.write(links[item.topic], item.log, raw)
    expected, _ = read(source)
    events, _ = read(target)
    assert [s.stamp for s in scans_of(events)] == [s.stamp for s in scans_of(expected)]
    np.testing.assert_array_equal(scans_of(events)[2].xyz, scans_of(expected)[2].xyz)
    np.testing.assert_array_equal(imu_stamps(events), imu_stamps(expected))


def test_late_scan_returns_to_its_place_and_is_counted(tmp_path: Path) -> None:
    messages = drive(6)
    clouds = [m for m in messages if m.msgtype == CLOUD]
    clouds[2].log, clouds[3].log = clouds[3].log, clouds[2].log
    events, reader = read(write_bag(tmp_path / "a.bag", sorted(messages, key=lambda m: m.log)))
    stamps = [scan.stamp for scan in scans_of(events)]
    assert stamps == sorted(stamps)
    assert reader.notes.counts["scans_out_of_order"] == 1


def test_late_imu_sample_returns_to_its_place(tmp_path: Path) -> None:
    messages = drive(3)
    samples = [m for m in messages if m.msgtype == IMU]
    samples[40].log, samples[42].log = samples[42].log, samples[40].log
    events, reader = read(write_bag(tmp_path / "a.bag", sorted(messages, key=lambda m: m.log)))
    assert np.all(np.diff(imu_stamps(events)) > 0)
    assert reader.notes.counts["imu_out_of_order"] > 0


def test_looped_bag_keeps_both_epochs_in_the_order_received(tmp_path: Path) -> None:
    messages = drive(20)
    later = max(m.log for m in messages) + NS
    again = [Recorded(m.log - START + later, m.topic, m.msgtype, m.message) for m in messages]
    events, reader = read(write_bag(tmp_path / "a.bag", messages + again))
    stamps = [scan.stamp for scan in scans_of(events)]
    assert stamps == [START + i * NS // 10 for i in range(20)] * 2
    assert reader.notes.counts["jumps_back"] >= 1
    assert any("new epoch" in message for message in reader.notes.messages)
    for event in events:
        if isinstance(event, ImuBlock):
            assert np.all(np.diff(event.stamps) > 0)


def test_header_stamps_count_not_the_times_of_reception(tmp_path: Path) -> None:
    messages = drive(3)
    for message in messages:
        message.log += 170_000_000 * NS
    events, reader = read(write_bag(tmp_path / "a.bag", messages))
    assert scans_of(events)[0].stamp == START
    assert not any("clock" in m for m in reader.notes.messages)


def test_clocks_that_never_meet_are_refused_with_all_three(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(3, imu_clock=1622 * NS - START))
    with pytest.raises(DataError, match="different clocks") as caught:
        read(path)
    text = str(caught.value)
    assert "1621.8" in text
    assert "1700000000.123" in text
    assert "--stamps log" in text
    events, _ = read(path, stamps="log")
    assert abs(int(imu_stamps(events)[0]) - START) < NS


def test_clocks_somewhat_apart_give_a_note(tmp_path: Path) -> None:
    _, reader = read(write_bag(tmp_path / "a.bag", drive(3, imu_clock=-2 * NS)))
    assert any("-1.90 s apart" in m for m in reader.notes.messages)


def test_wrong_topic_lists_what_is_there(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(2))
    with pytest.raises(DataError, match="no topic /velodyne") as caught:
        read(path, lidar={"topic": "/velodyne"})
    assert "/lidar/points (sensor_msgs/msg/PointCloud2, 2)" in str(caught.value)
    assert "/imu/data" in str(caught.value)
    with pytest.raises(DataError, match="/imu/data is a sensor_msgs/msg/Imu, not one of"):
        read(path, lidar={"topic": "/imu/data"})


def test_no_imu_topic(tmp_path: Path) -> None:
    messages = [m for m in drive(2) if m.msgtype == CLOUD]
    with pytest.raises(DataError, match=r"0 topics that could be imu.topic"):
        read(write_bag(tmp_path / "a.bag", messages))


def test_two_candidates_must_be_named(tmp_path: Path) -> None:
    messages = drive(2)
    messages += [Recorded(m.log, "/right", CLOUD, m.message) for m in messages if m.topic[1] == "l"]
    path = write_bag(tmp_path / "a.bag", sorted(messages, key=lambda m: m.log))
    with pytest.raises(DataError, match=r"2 topics that could be lidar.topic"):
        read(path)
    assert len(scans_of(read(path, lidar={"topic": "/right"})[0])) == 2


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "empty"), (b"no bag at all\n" * 50, "cannot be opened")],
)
def test_not_a_bag(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(content)
    with pytest.raises(DataError, match=said):
        read(path)


def test_cut_off_bag_fails_at_once(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(20))
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(DataError, match=r"a\.bag: "):
        read(path)


def test_unindexed_bag_fails_and_names_the_remedy(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(3))
    data = path.read_bytes()
    key = data.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(data[:key] + bytes(8) + data[key + 8 :])
    with pytest.raises(DataError, match="rosbag reindex"):
        read(path)


def test_damage_in_the_middle_says_how_far_it_came(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(20))
    data = bytearray(path.read_bytes())
    where = data.index(b"lidar", len(data) // 4)
    data[where - 8 : where + 4] = b"\xff" * 12
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"a\.bag: (damaged after \d+ scans|cannot be opened)"):
        read(path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        open_source(tmp_path / "none.bag")
    with pytest.raises(DataError, match=r"holds no \.bag"):
        open_source(tmp_path)


def test_configuration_file(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.bag", drive(2))
    config = tmp_path / "c.yaml"
    config.write_text("name: mine\nlidar: {rings: 16}\nhost: {filter_size_surf: 0.3}\n")
    source = open_source(path, config)
    assert source.name == "mine"
    config.write_text("lidar: {topics: /x}\n")
    with pytest.raises(ConfigError, match=r"lidar.topics = .* no such key"):
        open_source(path, config)
    config.write_text("T_imu_lidar: [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n")
    with pytest.raises(ConfigError, match="determinant 2"):
        open_source(path, config)
    with pytest.raises(ConfigError, match="stamps = 'received'"):
        open_source(path, stamps="received")


def test_real_mcap_with_three_clocks(real_data) -> None:
    path = real_data("pointcloudset_ouster_mcap/test.mcap")
    with pytest.raises(DataError, match=r"1622.472 s.*1588075038.630 s.*1592833242.6"):
        read(path)
    events, reader = read(path, stamps="log")
    assert reader.lidar_topic.name == "/os1_cloud_node/points"
    scans = scans_of(events)
    assert [len(s) for s in scans] == [64 * 2048] * 2
    assert sum(len(e) for e in events if isinstance(e, ImuBlock)) == 17
    # One column of 64 beams is one instant; ns from the stamp over one turn of 0.1 s.
    times = scans[0].times.reshape(2048, 64)
    assert times.dtype == np.uint32
    assert np.all(times == times[:, :1])
    assert 0.098e9 < int(times.max()) - int(times.min()) < 0.101e9
    assert scans[0].ring[:64].tolist() == list(range(64))
    valid = np.linalg.norm(scans[0].xyz, axis=1) > 0.1
    assert 0.2 < valid.mean() <= 1.0
    assert np.linalg.norm(scans[0].xyz[valid], axis=1).max() < 30.0
    accel = np.concatenate([e.accel for e in events if isinstance(e, ImuBlock)])
    assert np.linalg.norm(accel.mean(axis=0)) == pytest.approx(9.81, abs=0.5)


def test_packets_only_bag_lists_its_topics(real_data) -> None:
    with pytest.raises(DataError, match="/os_node0/lidar_packets"):
        read(real_data("ouster_sdk_tests/512x10_raw.bag"))
