# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""sequence.yaml: exactly the documented keys, each refused by name when wrong."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml
from d2lio.datasets.config import SourceConfig
from d2lio.errors import ConfigError, DataError
from d2lio.sequence import Sequence

GOOD = {
    "name": "room",
    "bag": "data.bag",
    "ground_truth": "gt.tum",
    "T_imu_lidar": np.eye(4).tolist(),
    "lidar": {
        "topic": "/points",
        "model": "vlp16",
        "rings": 16,
        "rate_hz": 10.0,
        "min_range_m": 0.5,
        "max_range_m": 100.0,
        "time_field": "time",
        "time_unit": "s",
    },
    "imu": {
        "topic": "/imu",
        "rate_hz": 200.0,
        "gyro_noise": 1e-4,
        "accel_noise": 1e-3,
        "gyro_walk": 1e-5,
        "accel_walk": 1e-4,
    },
}
KEYS = [
    *GOOD,
    *(f"lidar.{key}" for key in GOOD["lidar"]),
    *(f"imu.{key}" for key in GOOD["imu"]),
]


def changed(key: str, value: object) -> dict:
    data = copy.deepcopy(GOOD)
    *sections, last = key.split(".")
    target = data
    for section in sections:
        target = target[section]
    if value is None:
        del target[last]
    else:
        target[last] = value
    return data


def load(directory: Path, data: object) -> Sequence:
    (directory / "sequence.yaml").write_text(yaml.safe_dump(data))
    return Sequence.load(directory)


def test_round_trip(tmp_path: Path) -> None:
    sequence = load(tmp_path, GOOD)
    sequence.save(tmp_path)
    assert Sequence.load(tmp_path) == sequence
    assert sequence.bag_path == tmp_path / "data.bag"
    assert yaml.safe_load((tmp_path / "sequence.yaml").read_text()) == GOOD
    np.testing.assert_array_equal(sequence.extrinsic, np.eye(4))


def test_compensated_clouds_can_be_declared(tmp_path: Path) -> None:
    hints = {
        SourceConfig.from_sequence(load(tmp_path, data)).time_hint().synchronised
        for data in (changed("lidar.synchronised", True), changed("lidar.time_field", "x"))
    }
    assert hints == {True, False}
    assert load(tmp_path, changed("lidar.synchronised", True)).lidar.synchronised


@pytest.mark.parametrize("key", KEYS)
def test_every_missing_key_is_named_with_its_file(key: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="missing") as caught:
        load(tmp_path, changed(key, None))
    assert caught.value.key == key
    assert "sequence.yaml" in str(caught.value)


@pytest.mark.parametrize("key", ["nmae", "lidar.ringz", "imu.gyro_nois"])
def test_unknown_keys_are_named(key: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such key") as caught:
        load(tmp_path, changed(key, 1))
    assert caught.value.key == key


def test_a_misspelt_key_is_reported_as_unknown_first(tmp_path: Path) -> None:
    data = changed("lidar.rings", None)
    data["lidar"]["rigns"] = 16
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, data)
    assert caught.value.key == "lidar.rigns"
    assert "rings" in caught.value.allowed


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("lidar.rate_hz", 0.0),
        ("lidar.rate_hz", float("nan")),
        ("lidar.rings", -1),
        ("lidar.min_range_m", -0.1),
        ("lidar.time_unit", "minutes"),
        ("imu.gyro_noise", float("inf")),
        ("imu.accel_walk", -1.0),
        ("imu.topic", ""),
        ("T_imu_lidar", [[1.0, 0.0], [0.0, 1.0]]),
    ],
)
def test_values_out_of_range_are_refused(key: str, value: object, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, changed(key, value))
    assert caught.value.key.startswith(key)


def test_minimum_range_must_be_below_the_maximum(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="below max_range_m"):
        load(tmp_path, changed("lidar.min_range_m", 200.0))


def test_mirrored_extrinsic_is_refused_with_its_determinant(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="determinant -1"):
        load(tmp_path, changed("T_imu_lidar", np.diag([1.0, 1.0, -1.0, 1.0]).tolist()))


def test_absent_and_broken_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        Sequence.load(tmp_path)
    (tmp_path / "sequence.yaml").write_text("{")
    with pytest.raises(DataError, match="cannot be read"):
        Sequence.load(tmp_path)
    (tmp_path / "sequence.yaml").write_text("- a list")
    with pytest.raises(ConfigError):
        Sequence.load(tmp_path)
