# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""KITTI drive: extrinsic, rebuilt IMU, the real files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from d2lio.datasets import ImuBlock, Scan, open_source, timed_events
from d2lio.datasets.kitti import (
    GRAVITY,
    RINGS,
    Oxts,
    extrinsic,
    read_oxts,
    rebuild_imu,
    rings_by_turns,
)
from d2lio.errors import DataError
from d2lio.metrics import read_tum
from scipy.spatial.transform import Rotation

NS = 1_000_000_000
KITTI = "kitti_raw_2011_09_26_drive_0001"
# The speed is printed at 10 Hz with stamps of 10 ms; 107 m are driven.
END_ERROR_M = 1.5
YAW_ERROR_RAD = 0.01
ATTITUDE_ERROR_RAD = 2e-3  # ground truth and OXTS rows are rounded apart
RING_SPREAD_DEG = 0.35  # within a ring of a scan: the published points are corrected for offsets


def oxts(yaw_rate: float = 0.0, accel: float = 0.0, pitch: float = 0.0, speed: float = 10.0):
    stamps = np.arange(20, dtype=np.int64) * NS // 10
    t = stamps / NS
    yaw = yaw_rate * t
    angles = np.stack([0 * t, pitch + 0 * t, yaw], axis=1)
    return Oxts(stamps, angles, speed + accel * t, accel + 0 * t, yaw_rate + 0 * t)


def test_extrinsic_is_the_inverse_of_kittis() -> None:
    pose = extrinsic()
    # A point at the LiDAR's origin lies 0.81 m ahead of the IMU, 0.80 m above it.
    np.testing.assert_allclose(pose[:3, 3], [0.81, -0.31, 0.80], atol=0.02)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6)


def test_straight_and_level() -> None:
    imu = rebuild_imu(oxts())
    np.testing.assert_allclose(imu.gyro, 0.0, atol=1e-12)
    np.testing.assert_allclose(imu.accel, np.tile([0.0, 0.0, GRAVITY], (len(imu), 1)), atol=1e-12)
    assert np.all(np.diff(imu.stamps) == NS // 100)
    assert imu.stamps[0] <= -NS // 4


def test_turning_needs_centripetal_acceleration() -> None:
    imu = rebuild_imu(oxts(yaw_rate=0.3, speed=8.0))
    np.testing.assert_allclose(imu.gyro[:, 2], 0.3, atol=1e-9)
    np.testing.assert_allclose(imu.accel[:, 1], 2.4, atol=1e-9)


def test_pitched_car_feels_gravity_along_its_axis() -> None:
    # Pitch about y turns x downwards: nose down, gravity's reaction points backwards.
    imu = rebuild_imu(oxts(pitch=0.1))
    np.testing.assert_allclose(imu.accel[:, 0], -GRAVITY * np.sin(0.1), atol=1e-9)
    np.testing.assert_allclose(imu.accel[:, 2], GRAVITY * np.cos(0.1), atol=1e-9)


def test_braking_shows_forward() -> None:
    np.testing.assert_allclose(rebuild_imu(oxts(accel=-1.5)).accel[:, 0], -1.5, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# index,timestamp\n0,1.0\n", "no column roll_rad"),
        ("# index,timestamp,roll_rad,pitch_rad,yaw_rad,vf_mps,af_mps2,wz_degps\n", "too few rows"),
        (
            "# index,timestamp,roll_rad,pitch_rad,yaw_rad,vf_mps,af_mps2,wz_degps\n"
            + "0,1.0,0,0,zero,0,0,0\n" * 5,
            "zero",
        ),
    ],
)
def test_bad_oxts(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "oxts.csv").write_text(text)
    with pytest.raises(DataError, match=said):
        read_oxts(tmp_path / "oxts.csv")


def test_scans_and_rows_must_match(tmp_path: Path, real_data) -> None:
    (tmp_path / "scans").mkdir()
    (tmp_path / "oxts.csv").write_bytes((real_data(KITTI) / "oxts.csv").read_bytes())
    with pytest.raises(DataError, match="0 scans but 108 rows"):
        open_source(tmp_path)


def test_real_drive_in_order_with_truth(real_data) -> None:
    source = open_source(real_data(KITTI))
    assert source.ground_truth is not None
    assert source.reader.scan_total == 108
    newest_imu, scans = -1, 0
    for event in timed_events(source.reader):
        if isinstance(event, ImuBlock):
            newest_imu = int(event.stamps[-1])
            continue
        assert isinstance(event, Scan)
        assert 0 <= event.stamp - newest_imu < NS // 100
        assert not event.dt_ns.any()
        assert event.ring is not None
        assert np.array_equal(np.unique(event.ring), np.arange(RINGS))
        scans += 1
        if scans == 3:
            assert len(event) > 100_000
            break


def test_rings_of_a_real_scan_lie_one_above_the_other(real_data) -> None:
    with np.load(sorted((real_data(KITTI) / "scans").glob("*.npz"))[0]) as data:
        xyz = data["xyz"]
    ring = rings_by_turns(xyz)
    assert ring is not None
    elevation = np.rad2deg(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    centre = np.array([np.median(elevation[ring == r]) for r in range(RINGS)])
    spread = np.array([elevation[ring == r].std() for r in range(RINGS)])
    assert np.all(np.diff(centre) > 0.0)
    assert np.all(spread < RING_SPREAD_DEG)
    assert centre[0] == pytest.approx(-24.0, abs=1.0)
    assert centre[-1] == pytest.approx(2.0, abs=1.0)


def test_rings_by_turns() -> None:
    turn = np.linspace(0.05, 2 * np.pi - 0.05, 40)
    azimuth = np.concatenate([turn, turn[3:], turn[:-5]])
    xyz = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1).astype(np.float32)
    expected = np.repeat([63, 62, 61], [40, 37, 35])
    assert rings_by_turns(xyz).tolist() == expected.tolist()
    shuffled = np.random.default_rng(0).permutation(np.tile(xyz, (9, 1)))
    assert rings_by_turns(shuffled) is None


def test_attitude_of_the_drive_is_given_when_asked_for(tmp_path: Path, real_data) -> None:
    folder = real_data(KITTI)
    silent = next(iter(open_source(folder).reader.raw_events()))
    assert isinstance(silent, ImuBlock)
    assert silent.orientation is None
    config = tmp_path / "kitti.yaml"
    config.write_text("lidar: {synchronised: true}\nimu: {orientation: true}\n")
    events = open_source(folder, config).reader.raw_events()
    blocks = [event for event in events if isinstance(event, ImuBlock)]
    stamps = np.concatenate([block.stamps for block in blocks])
    given = Rotation.from_quat(np.concatenate([block.orientation for block in blocks]))
    truth = read_tum(folder / "gt_imu_tum.txt")
    at = np.searchsorted(stamps, truth.stamps)
    # Both are attitudes of the same unit; the truth starts at its first pose.
    turned = given[at[0]].inv() * given[at]
    error = turned.inv() * Rotation.from_quat(truth.quaternions)
    assert error.magnitude().max() < ATTITUDE_ERROR_RAD


def test_integrating_the_rebuilt_imu_follows_the_real_truth(real_data) -> None:
    folder = real_data(KITTI)
    imu = rebuild_imu(read_oxts(folder / "oxts.csv"))
    truth = read_tum(folder / "gt_imu_tum.txt")
    inside = (imu.stamps >= truth.stamps[0]) & (imu.stamps <= truth.stamps[-1])
    yaw = np.cumsum(imu.gyro[inside, 2]) * 0.01
    x, y, z, w = truth.quaternions.T
    true_yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    assert yaw[-1] == pytest.approx(true_yaw[-1] - true_yaw[0], abs=YAW_ERROR_RAD)
    first = read_oxts(folder / "oxts.csv").forward_velocity[0]
    pitch_free = imu.accel[inside, 0] - _gravity_share(folder, imu, inside)
    speed = first + np.cumsum(pitch_free) * 0.01
    assert float(speed.sum() * 0.01) == pytest.approx(truth.path_m, abs=END_ERROR_M)


def _gravity_share(folder: Path, imu: ImuBlock, inside: np.ndarray) -> np.ndarray:
    rows = read_oxts(folder / "oxts.csv")
    pitch = np.interp(imu.stamps[inside], rows.stamps, rows.roll_pitch_yaw[:, 1])
    return -GRAVITY * np.sin(pitch)
