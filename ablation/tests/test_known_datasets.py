# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What is known of GEODE, SubT-MRS and ECMD: configurations, names, ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from d2lio.datasets.catalog import datasets, device
from d2lio.datasets.recognise import find_truth, recognise
from d2lio.datasets.truth import at_truth_body, moved, read_csv_ns, read_truth
from d2lio.errors import ConfigError, DataError
from d2lio.metrics import evaluate, read_tum
from d2lio.metrics.tum import Trajectory
from d2lio.metrics.tum import write as write_tum
from d2lio.sequence import ROTATION_TOLERANCE
from d2lio.source_params import source_params
from scipy.spatial.transform import Rotation

NS = 1_000_000_000
ROUNDING = 1e-3  # the published rotations have three to nine digits
POSE_TOLERANCE = 1e-9
CALIBRATION_M = 2e-3  # a published transform against the inverse of its counterpart

DEVICES = [f"{d.name}/{name}" for d in datasets().values() for name in d.devices]
CLOUD = "sensor_msgs/msg/PointCloud2"
IMU = "sensor_msgs/msg/Imu"


@pytest.mark.parametrize("name", DEVICES)
def test_every_device_gives_a_configuration_for_every_host(name: str) -> None:
    known = device(name)
    config = known.source_config("x")
    R = config.extrinsic[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R, known.T_imu_lidar.R, atol=ROUNDING)
    np.testing.assert_array_equal(config.extrinsic[:3, 3], known.T_imu_lidar.t)
    for host in ("fastlio", "liosam", "d2lio"):
        assert source_params(config, host)
    assert config.time_hint().period_s == pytest.approx(0.1, rel=0.02)


def test_a_rotation_that_would_be_refused_is_told_and_repaired() -> None:
    rc2 = device("subt_mrs/rc2")
    assert rc2.T_imu_lidar.rotation_error > ROTATION_TOLERANCE
    assert any("nearest rotation" in remark for remark in rc2.remarks())


def test_noise_and_units() -> None:
    gamma = device("geode/gamma")
    assert gamma.source_config().hosts["d2lio"]["imuAccNoise"] == 5.574e-3
    assert gamma.imu.accel_unit == "m/s^2"
    assert [imu.accel_unit for imu in gamma.other_imus] == ["g"]
    assert device("subt_mrs/ugv").source_config().hosts["d2lio"] == {}
    assert not device("ecmd/car").T_imu_lidar.exact
    with pytest.raises(ConfigError, match="geode/gamma"):
        device("geode/delta")


def test_names_are_unique_and_refer_to_what_is_described() -> None:
    for dataset in datasets().values():
        names = [s.name for s in dataset.sequences]
        assert len(set(names)) == len(names)
        for entry in (*dataset.sequences, *dataset.patterns):
            assert entry.device in dataset.devices
            assert entry.truth is None or entry.truth in dataset.truths
        for kind in dataset.truths.values():
            assert set(kind.devices) <= set(dataset.devices)


@pytest.mark.parametrize(
    ("path", "topics", "expected"),
    [
        ("Metro_tunnel/Shield_tunnel1_gamma/Shield_tunnel1_gamma.bag", {}, "Shield_tunnel1_gamma"),
        ("offroad7_BETA.bag", {}, "Offroad7_beta"),
        ("Shield_tunnel10_beta.bag", {}, "Shield_tunnel10_beta"),
        ("Hawkins_Long_Corridor/raw_data_0.bag", {}, "Hawkins_Long_Corridor_RC"),
        ("Urban_Challenge_UGV1/raw_data_core_0.bag", {}, "Urban_Challenge_UGV1"),
        ("Bridge_night_difficult_c.bag", {}, "Bridge_night_difficult_c"),
        ("Tunnel_easy_a/x.bag", {}, "Tunnel_easy_a"),
        ("Offroad10.bag", {}, None),
        ("mine/test.bag", {}, None),
    ],
)
def test_sequences_by_name(path: str, topics: dict[str, str], expected: str | None) -> None:
    match = recognise(Path("/data") / path, topics)
    assert (match.sequence.name if match and match.sequence else None) == expected


def test_devices_by_folder_and_topics() -> None:
    ouster = {"/ouster/points": CLOUD, "/imu/data": IMU}
    match = recognise(Path("/data/geode/run.bag"), ouster)
    assert match is not None
    assert (match.device_name, match.sequence, match.by) == ("beta", None, "folder")
    match = recognise(Path("/data/other/run.bag"), ouster)
    assert match is not None
    assert match.by == "topics"
    # A VLP-16, an HDL-32E and a converted SubT-MRS bag have the same topics.
    assert recognise(Path("/d/run.bag"), {"/velodyne_points": CLOUD, "/imu/data": IMU}) is None


def test_truth_in_the_published_folders(tmp_path: Path) -> None:
    bag = tmp_path / "sensor_data/Offroad/Offroad2_gamma/Offroad2_gamma.bag"
    truth = tmp_path / "groundtruth/traj/Offroad2.txt"
    for file in (bag, truth):
        file.parent.mkdir(parents=True)
        file.touch()
    match = recognise(bag, {})
    assert match is not None
    assert find_truth(bag, match) == truth
    beside = bag.with_suffix(".txt")
    beside.touch()
    assert find_truth(bag, match) == beside


def test_truth_of_another_sequence_is_not_taken(tmp_path: Path) -> None:
    for name in ("Urban_Challenge_UGV1", "Urban_Challenge_UGV2"):
        (tmp_path / name).mkdir()
    (tmp_path / "Urban_Challenge_UGV2/ground_truth_path.csv").touch()
    first = recognise(tmp_path / "Urban_Challenge_UGV1", {})
    second = recognise(tmp_path / "Urban_Challenge_UGV2", {})
    assert first is not None
    assert second is not None
    assert find_truth(tmp_path / "Urban_Challenge_UGV1", first) is None
    assert find_truth(tmp_path / "Urban_Challenge_UGV2", second) is not None


def wandering(count: int = 50, seed: int = 0) -> Trajectory:
    rng = np.random.default_rng(seed)
    stamps = 1_700_000_000 * NS + np.arange(count, dtype=np.int64) * NS // 10
    positions = np.cumsum(rng.normal(0.0, 0.3, (count, 3)), axis=0)
    quaternions = Rotation.from_rotvec(np.cumsum(rng.normal(0.0, 0.1, (count, 3)), 0)).as_quat()
    return Trajectory(stamps, positions, quaternions)


def write_truth(path: Path, body: Trajectory, *, offset: np.ndarray, rotation: bool) -> Path:
    with path.open("w") as out:
        for stamp, p, q in zip(body.stamps, body.positions + offset, body.quaternions, strict=True):
            numbers = [*p, *(q if rotation else (0, 0, 0, 0))]
            out.write(f"{stamp // NS}.{stamp % NS:09d} " + " ".join(map(repr, map(float, numbers))))
            out.write("\n")
    return path


def test_geode_truth_moves_to_the_imu_as_the_authors_move_the_estimate(tmp_path: Path) -> None:
    kind = datasets()["geode"].truths["gnss"]
    T_gt_gamma = kind.devices["gamma"].matrix()
    imu = wandering()
    body = moved(imu, np.linalg.inv(T_gt_gamma))  # T_eval = T_est inv(T_dev->gt)
    utm = np.array([685_123.4, 2_567_890.1, 12.0])
    file = write_truth(tmp_path / "t.txt", body, offset=utm, rotation=True)
    truth = read_truth(file, kind, "gamma")
    assert truth.in_imu_frame
    np.testing.assert_allclose(
        truth.trajectory.positions + truth.origin - utm, imu.positions, atol=1e-8
    )
    turned = (
        Rotation.from_quat(truth.trajectory.quaternions) * Rotation.from_quat(imu.quaternions).inv()
    )
    assert turned.magnitude().max() < POSE_TOLERANCE
    assert any("relative to the first" in note for note in truth.notes)


def test_position_only_truth_stays_and_the_estimate_moves(tmp_path: Path) -> None:
    kind = datasets()["geode"].truths["leica"]
    imu = wandering(seed=1)
    body = moved(imu, np.linalg.inv(kind.devices["gamma"].matrix()))
    file = write_truth(tmp_path / "t.txt", body, offset=np.zeros(3), rotation=False)
    truth = read_truth(file, kind, "gamma")
    assert truth.trajectory.position_only
    assert not truth.in_imu_frame
    assert any("the estimate must be moved" in note for note in truth.notes)
    at_body = at_truth_body(imu, truth)
    np.testing.assert_allclose(at_body.positions, truth.trajectory.positions, atol=1e-9)
    assert np.linalg.norm(imu.positions - body.positions, axis=1).min() > 0.4  # the lever
    own = read_truth(file, kind, "alpha")
    assert own.in_imu_frame
    np.testing.assert_array_equal(at_truth_body(imu, own).positions, imu.positions)
    with pytest.raises(DataError, match="without attitude"):
        moved(truth.trajectory, np.eye(4))


def test_truth_of_an_unknown_body_says_so(tmp_path: Path) -> None:
    kind = datasets()["geode"].truths["vicon"]
    imu = wandering(seed=2)
    file = write_truth(tmp_path / "t.txt", imu, offset=np.zeros(3), rotation=True)
    truth = read_truth(file, kind, "gamma")
    assert not truth.in_imu_frame
    assert any("not moved" in note for note in truth.notes)


def test_transforms_of_gnss_and_leica_are_each_others_inverse() -> None:
    """beta is the body of one and alpha that of the other: two numbers published for one lever."""
    truths = datasets()["geode"].truths
    there, back = truths["gnss"].devices["alpha"], truths["leica"].devices["beta"]
    np.testing.assert_allclose(there.matrix() @ back.matrix(), np.eye(4), atol=CALIBRATION_M)


def test_subt_csv_in_nanoseconds(tmp_path: Path) -> None:
    imu = wandering(seed=3)
    file = tmp_path / "ground_truth_path.csv"
    with file.open("w") as out:
        out.write("timestamp[ns],p_w_b_x,p_w_b_y,p_w_b_z,qx,qy,qz,qw\n")
        for stamp, p, q in zip(imu.stamps, imu.positions, imu.quaternions, strict=True):
            out.write(",".join([str(stamp), *(repr(float(v)) for v in (*p, *q))]) + "\n")
    read = read_csv_ns(file)
    np.testing.assert_array_equal(read.stamps, imu.stamps)
    np.testing.assert_allclose(read.positions, imu.positions)
    np.testing.assert_allclose(read.quaternions, imu.quaternions, atol=1e-12)
    truth = read_truth(file, datasets()["subt_mrs"].truths["path"], "rc2")
    assert truth.in_imu_frame
    np.testing.assert_allclose(truth.trajectory.positions, imu.positions)
    for text, said in (("a,b\n", "no poses"), ("1,2,3\n", "columns"), ("", "no poses")):
        file.write_text(text)
        with pytest.raises(DataError, match=said):
            read_csv_ns(file)
    file.write_text("5,0,0,0,0,0,0,1\n4,0,0,0,0,0,0,1\n")
    with pytest.raises(DataError, match="do not grow"):
        read_csv_ns(file)


def test_ecmd_truth_once_a_second(tmp_path: Path) -> None:
    imu = wandering(seed=4).select(np.arange(0, 50, 10))
    file = write_truth(tmp_path / "gt.txt", imu, offset=np.zeros(3), rotation=True)
    truth = read_truth(file, datasets()["ecmd"].truths["span"], "car")
    assert truth.in_imu_frame
    assert truth.trajectory.period_s == pytest.approx(1.0)
    np.testing.assert_allclose(truth.trajectory.positions, read_tum(file).positions)


def test_moving_the_estimate_to_the_prism_takes_the_levers_error_away(tmp_path: Path) -> None:
    pytest.importorskip("evo", reason="evo is not installed (an extra)")
    kind = datasets()["geode"].truths["leica"]
    imu = wandering(count=100, seed=5)
    body = moved(imu, np.linalg.inv(kind.devices["beta"].matrix()))
    file = write_truth(tmp_path / "t.txt", body, offset=np.zeros(3), rotation=False)
    truth = read_truth(file, kind, "beta")
    write_tum(tmp_path / "imu.tum", imu)
    write_tum(tmp_path / "moved.tum", at_truth_body(imu, truth))
    errors = {}
    for name in ("imu", "moved"):
        result, _ = evaluate(tmp_path / f"{name}.tum", file)
        assert result.position_only
        assert result.ate is not None
        errors[name] = result.ate.rmse
    assert errors["moved"] < 1e-6 < 0.1 < errors["imu"]
