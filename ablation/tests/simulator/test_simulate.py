# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The whole chain: files written, repeatability, refusals."""

from __future__ import annotations

import errno
import hashlib
from pathlib import Path

import numpy as np
import pytest
from d2lio.errors import ConfigError, DataError
from d2lio.sequence import Sequence
from d2lio.simulator import IMU_GRADES, SCENES, SENSORS, Seeds, simulate
from d2lio.simulator.bag import POINT, BagWriter
from d2lio.simulator.pipeline import EPOCH_NS
from rosbags.highlevel import AnyReader

SECOND = 1_000_000_000


def digest(sequence: Sequence) -> str:
    return hashlib.sha256(sequence.bag_path.read_bytes()).hexdigest()


def stamp_of(message) -> int:
    return message.header.stamp.sec * SECOND + message.header.stamp.nanosec


def messages(sequence: Sequence):
    with AnyReader([sequence.bag_path]) as reader:
        for connection, arrival, raw in reader.messages():
            yield connection.topic, arrival, reader.deserialize(raw, connection.msgtype)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    return simulate("room", tmp_path_factory.mktemp("sim") / "room", duration=3.0, seed=5)


@pytest.mark.parametrize("scene", list(SCENES))
def test_every_scene_simulates(scene: str, tmp_path: Path) -> None:
    sequence = simulate(scene, tmp_path / scene, duration=1.0)
    clouds = [m for topic, _, m in messages(sequence) if topic == sequence.lidar.topic]
    assert len(clouds) == 7
    assert min(cloud.width for cloud in clouds) > 1000


@pytest.mark.parametrize("sensor", list(SENSORS))
def test_every_sensor_simulates(sensor: str, tmp_path: Path) -> None:
    sequence = simulate("room", tmp_path / "s", duration=0.6, sensor=sensor)
    assert sequence.lidar.model == sensor
    assert sequence.lidar.rings == SENSORS[sensor].rings


@pytest.mark.parametrize("grade", list(IMU_GRADES))
def test_the_file_states_the_densities_that_were_used(grade: str, tmp_path: Path) -> None:
    sequence = simulate("flat_ground", tmp_path / "s", duration=0.6, imu=grade)
    assert sequence.imu.accel_noise == IMU_GRADES[grade].accel_noise
    assert sequence.imu.gyro_walk == IMU_GRADES[grade].gyro_walk


def test_messages_come_in_order_and_the_imu_surrounds_the_scans(room: Sequence) -> None:
    arrivals, lidar, imu = [], [], []
    for topic, arrival, message in messages(room):
        arrivals.append(arrival)
        (lidar if topic == room.lidar.topic else imu).append(stamp_of(message))
    assert arrivals == sorted(arrivals)
    assert lidar[0] - imu[0] >= SECOND // 10
    assert imu[-1] - (lidar[-1] + SECOND // 10) >= SECOND // 10
    assert set(np.diff(imu)) == {SECOND // 200}
    assert imu[0] == EPOCH_NS  # no nanosecond lost


def test_clouds_have_the_layout_of_the_velodyne_driver(room: Sequence) -> None:
    cloud = next(m for topic, _, m in messages(room) if topic == room.lidar.topic)
    names = ["x", "y", "z", "intensity", "ring", "time"]
    assert [field.name for field in cloud.fields] == names
    assert [field.offset for field in cloud.fields] == [0, 4, 8, 12, 16, 18]
    assert [field.datatype for field in cloud.fields] == [7, 7, 7, 7, 4, 7]
    assert cloud.point_step == 22
    points = np.frombuffer(cloud.data.tobytes(), dtype=POINT)
    assert len(points) == cloud.width
    assert 0.0 <= points["time"].min() < 1e-3
    assert 0.098 < points["time"].max() < 0.1001
    assert points["ring"].max() == 15


def test_ground_truth_is_dense_and_well_formed(room: Sequence) -> None:
    lines = room.ground_truth_path.read_text().splitlines()
    rows = np.array([line.split() for line in lines], dtype=float)
    assert rows.shape == (601, 8)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0, atol=1e-8)
    seconds, fraction = lines[1].split()[0].split(".")
    assert int(seconds) * SECOND + int(fraction) == EPOCH_NS + SECOND // 200


def test_same_seed_same_bytes(room: Sequence, tmp_path: Path) -> None:
    again = simulate("room", tmp_path / "again", duration=3.0, seed=5)
    assert digest(again) == digest(room)
    assert again.ground_truth_path.read_bytes() == room.ground_truth_path.read_bytes()
    other = simulate("room", tmp_path / "other", duration=3.0, seed=6)
    assert digest(other) != digest(room)


def test_movers_repeat_too(tmp_path: Path) -> None:
    runs = [simulate("dense_street", tmp_path / name, duration=1.0) for name in "ab"]
    assert digest(runs[0]) == digest(runs[1])


def test_seeds_act_apart(tmp_path: Path) -> None:
    def truth(seeds: Seeds) -> tuple[bytes, str]:
        sequence = simulate("room", tmp_path / "s", duration=0.6, seed=seeds)
        return sequence.ground_truth_path.read_bytes(), digest(sequence)

    base, noise = truth(Seeds(1, 1, 1)), truth(Seeds(1, 1, 2))
    scene, motion = truth(Seeds(2, 1, 1)), truth(Seeds(1, 2, 1))
    assert base[0] == noise[0] == scene[0] != motion[0]
    assert len({base[1], noise[1], scene[1], motion[1]}) == 4


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("scene", "moon", "tunnel_cabinets"),
        ("sensor", "vlp17", "vlp16"),
        ("imu", "best", "industrial"),
        ("duration", 0.0, "3600"),
        ("duration", float("nan"), "3600"),
        ("range_noise", -0.01, "0"),
        ("seed", -1, "integer"),
    ],
)
def test_bad_arguments_are_refused_by_name(
    key: str, value: object, named: str, tmp_path: Path
) -> None:
    arguments = {"scene": "room", "out": tmp_path / "s", key: value}
    with pytest.raises(ConfigError, match=named) as caught:
        simulate(**arguments)
    assert caught.value.key.startswith(key)
    assert not (tmp_path / "s").exists()


def test_full_disk_is_one_clear_error_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    former = digest(simulate("room", tmp_path / "s", duration=0.6))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(BagWriter, "cloud", full)
    with pytest.raises(DataError, match="the disk is full"):
        simulate("room", tmp_path / "s", duration=0.6, seed=9)
    assert [path.name for path in tmp_path.iterdir()] == ["s"]
    assert digest(Sequence.load(tmp_path / "s")) == former


def test_a_directory_with_other_files_is_never_replaced(tmp_path: Path) -> None:
    target = tmp_path / "s"
    simulate("room", target, duration=0.6)
    simulate("room", target, duration=0.6)  # its own output may be replaced
    (target / "notes.txt").write_text("mine")
    with pytest.raises(DataError, match="left as it is"):
        simulate("room", target, duration=0.6)
    assert (target / "notes.txt").read_text() == "mine"


def test_progress_counts_every_scan(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    simulate("room", tmp_path / "s", duration=1.0, progress=lambda *step: seen.append(step))
    assert seen == [(index + 1, 7) for index in range(7)]
