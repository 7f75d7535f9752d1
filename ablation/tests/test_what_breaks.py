# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What runs are reduced to along the axis, on results made up, and one short study."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from d2lio import what_breaks
from d2lio.errors import DataError
from d2lio.metrics import Trajectory
from d2lio.report import weak_axis
from d2lio.simulator import IMU_GRADES, Seeds
from d2lio.simulator import imu as imu_model
from d2lio.simulator.imu import GRAVITY
from d2lio.simulator.pipeline import EPOCH_NS, build_world
from d2lio.simulator.trajectory import STANDSTILL
from d2lio.what_breaks import METHODS, Along, Drive, Summary, along, summarised
from scipy.spatial.transform import Rotation

DURATION = 8.0  # s
BIAS = np.array([0.04, -0.02, 0.01])  # m/s^2, body
EXACT = 1e-6
AXIS_TILT = 0.005  # 0.3 times that of the axis and of the nose, which shakes, in the world


@pytest.fixture(scope="module")
def drive() -> Drive:
    """A tunnel's motion without its scans, and an accelerometer with a bias that stays."""
    motion = build_world("tunnel", Seeds(), DURATION).trajectory
    samples = imu_model.sample_times(DURATION)
    seconds = samples * 1e-9
    position, _ = motion.pose(seconds)
    stamps = EPOCH_NS + samples
    truth = Trajectory(stamps, position, motion.quaternion(seconds))
    return Drive(Path("tunnel"), truth, motion, stamps, np.tile(BIAS, (len(stamps), 1)))


MAP = Rotation.from_euler("ZYX", [70.0, 3.0, -2.0], degrees=True)  # R_map_world


def results(drive: Drive, **changes: np.ndarray) -> list[SimpleNamespace]:
    """Of a perfect estimator whose map is turned, but for `changes`: added, in the world."""
    out = []
    for stamp in drive.stamps[50::20]:
        t = np.array([(stamp - EPOCH_NS) * 1e-9])
        position, rotation = (value[0] for value in drive.motion.pose(t))
        moved = float(t[0]) > STANDSTILL
        pose = np.eye(4)
        pose[:3, :3] = MAP.as_matrix() @ rotation
        pose[:3, 3] = MAP.apply(position + moved * changes.get("position", np.zeros(3)))
        velocity = drive.motion.velocity(t)[0] + changes.get("velocity", np.zeros(3))
        gravity = np.array([0.0, 0.0, -GRAVITY]) + changes.get("gravity", np.zeros(3))
        out.append(
            SimpleNamespace(
                stamp=int(stamp),
                T_map_imu=pose,
                velocity=MAP.apply(velocity),
                accel_bias=BIAS + rotation.T @ changes.get("accel_bias", np.zeros(3)),
                gravity=MAP.apply(gravity),
                correction=MAP.apply(changes.get("correction", np.zeros(3))),
                diagnostics={"lambda_t_1": 7},
            )
        )
    return out


def test_a_perfect_run_has_no_error(drive: Drive) -> None:
    run = along(results(drive), drive)
    for column in (run.error, run.velocity, run.bias - run.bias_true, run.correction):
        assert np.abs(column).max() < EXACT
    assert np.abs(run.bias_true - BIAS[0]).max() < AXIS_TILT
    assert set(run.weakest) == {7.0}
    assert run.seconds[0] == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("change", "column", "sign"),
    [
        ("position", "error", 1.0),
        ("velocity", "velocity", 1.0),
        ("correction", "correction", 1.0),
        ("accel_bias", "bias", 1.0),
        ("gravity", "bias", -1.0),
    ],
)
def test_what_is_wrong_along_the_tunnel_shows_in_its_column_alone(
    drive: Drive, change: str, column: str, sign: float
) -> None:
    right = along(results(drive), drive)
    wrong = along(results(drive, **{change: np.array([0.3, 0.0, 0.0])}), drive)
    for name in ("error", "velocity", "bias", "correction"):
        differs = (getattr(wrong, name) - getattr(right, name))[right.seconds > STANDSTILL]
        expected = sign * 0.3 if name == column else 0.0
        assert differs == pytest.approx(np.full(len(differs), expected), abs=AXIS_TILT)


def test_what_is_wrong_across_does_not_show(drive: Drive) -> None:
    wrong = along(results(drive, velocity=np.array([0.0, 0.3, -0.3])), drive)
    assert np.abs(wrong.velocity).max() < AXIS_TILT


def test_without_poses_or_motion_there_is_no_axis(drive: Drive) -> None:
    with pytest.raises(DataError, match="no poses"):
        along([], drive)
    with pytest.raises(DataError, match="nothing moves"):
        along(results(drive)[:1], drive)


def test_the_accelerometer_error_is_its_bias_without_the_noise() -> None:
    motion = build_world("tunnel", Seeds(), DURATION).trajectory
    stamps = imu_model.sample_times(DURATION)
    _, force = imu_model.ideal(motion, stamps * 1e-9)
    noise = IMU_GRADES["industrial"].accel_noise * np.sqrt(imu_model.RATE_HZ)
    accel = force + BIAS + noise * np.random.default_rng(1).standard_normal(force.shape)
    found = what_breaks.accelerometer_error(EPOCH_NS + stamps, accel, motion)
    assert np.abs(found - BIAS).max() < 0.5 * noise  # 5 sigma of the mean of half a window


def test_a_running_mean_keeps_a_slope_and_its_ends() -> None:
    values = np.column_stack([np.arange(9.0), np.full(9, 2.0)])
    found = what_breaks.smoothed(values, 4)
    assert found[2:-2] == pytest.approx(values[2:-2])
    assert found[0] == pytest.approx([1.0, 2.0])
    assert what_breaks.smoothed(np.empty((0, 3)), 4).shape == (0, 3)


def test_the_summary_leaves_the_standstill_out() -> None:
    seconds = np.array([1.0, 2.5, 3.0, 3.5])
    run = Along(
        seconds=seconds,
        error=np.array([0.0, 0.1, -0.3, -0.2]),
        weakest=np.array([np.nan, 3.0, 5.0, 9.0]),
        velocity=np.array([9.0, 0.1, -0.4, 0.2]),
        bias=np.array([9.0, 0.0, 0.1, 0.1]),
        bias_true=np.full(4, 0.05),
        correction=np.array([9.0, 0.03, np.nan, -0.04]),
    )
    expected = Summary(-0.2, 0.4, 0.05, np.sqrt(0.00125), 5.0)
    assert summarised(run) == pytest.approx(expected)
    with pytest.raises(DataError, match="before anything moves"):
        summarised(run, standstill=4.0)


def test_rolling_rms_skips_what_is_not_known() -> None:
    seconds = np.arange(6) * 0.4
    values = np.array([3.0, np.nan, 3.0, np.nan, np.nan, np.nan])
    found = weak_axis.rolling_rms(seconds, values, 1.0)
    assert found[:4] == pytest.approx(np.full(4, 3.0))
    assert np.isnan(found[4:]).all()


def test_every_method_has_a_look_of_its_own() -> None:
    looks = weak_axis.styles([method.title for method in METHODS])
    assert list(looks) == [method.title for method in METHODS]
    assert len({look["color"] for look in looks.values()}) == len(METHODS)


def test_the_study_writes_figure_and_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--hosts", "fastlio", "--duration", "4", "--out", str(tmp_path)]
    assert what_breaks.main(arguments) == 0
    picture = (tmp_path / "degeneracy_tunnel_cabinets_fastlio.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    with (tmp_path / "tunnel_cabinets_0.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["method"] for line in lines] == [method.title for method in METHODS]
    assert all(np.isfinite(float(line["end_m"])) for line in lines)
    assert "noise_aware" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", ["--scene room", "--hosts none"])
def test_command_refuses_what_it_cannot_run(arguments: str) -> None:
    with pytest.raises(SystemExit) as stopped:
        what_breaks.main(arguments.split())
    assert stopped.value.code == 2
