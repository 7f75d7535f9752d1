# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Scores: parity with evo's command line, matching in time, coverage, failure."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from d2lio.errors import ConfigError, DataError
from d2lio.metrics import EvaluateOptions, Trajectory, evaluate, read_tum
from d2lio.metrics.matching import coverage, match
from d2lio.metrics.plot import plot_curves
from d2lio.metrics.tum import interpolate, write
from scipy.spatial.transform import Rotation

NS = 1_000_000_000
START = 1_700_000_000 * NS
EVO_PARITY = 1e-6  # evo's command line prints six decimals
LINEAR_ERROR_M = 2e-4  # a dt^2 / 8 at 2 m/s^2, 100 Hz, with room
MODULE = {"ape": "evo_ape", "rpe": "evo_rpe"}


def curve(t: np.ndarray, speed: float = 20.0) -> tuple[np.ndarray, Rotation]:
    """Position [N, 3] and attitude of a fast winding drive at times t [N] in s."""
    position = np.stack([speed * t, 8.0 * np.sin(0.5 * t), 0.5 * np.cos(0.3 * t)], axis=1)
    yaw = np.arctan2(4.0 * np.cos(0.5 * t), speed)
    return position, Rotation.from_euler("ZYX", np.stack([yaw, 0.05 * np.sin(t), 0 * t], 1))


def trajectory(stamps: np.ndarray, noise: float = 0.0, seed: int = 0) -> Trajectory:
    position, rotation = curve((stamps - START) / NS)
    rng = np.random.default_rng(seed)
    position = position + rng.normal(0.0, noise, position.shape)
    jitter = Rotation.from_rotvec(rng.normal(0.0, noise / 10.0, position.shape))
    return Trajectory(stamps, position, (rotation * jitter).as_quat())


def moved(trajectory: Trajectory) -> Trajectory:
    """The same in another map frame."""
    turn = Rotation.from_euler("ZYX", [1.0, 0.2, -0.1])
    return Trajectory(
        trajectory.stamps,
        turn.apply(trajectory.positions) + np.array([5.0, -7.0, 1.0]),
        (turn * Rotation.from_quat(trajectory.quaternions)).as_quat(),
    )


def stamps(hz: float, seconds: float = 20.0, offset_ns: int = 0) -> np.ndarray:
    return START + offset_ns + np.arange(int(seconds * hz), dtype=np.int64) * int(NS / hz)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """Estimate at 10 Hz between the stamps of a truth at 100 Hz."""
    estimate, truth = tmp_path / "trajectory.tum", tmp_path / "gt.tum"
    write(estimate, moved(trajectory(stamps(10, offset_ns=4_700_000), noise=0.02)))
    write(truth, trajectory(stamps(100, 20.2)))
    return estimate, truth


def evo_cli(tool: str, truth: str, estimate: str, *arguments: str) -> float:
    """RMSE as printed by evo's own command line."""
    command = [sys.executable, "-c", f"from evo.cli.{tool} import main; main()"]
    program = Path(sys.executable).with_name(MODULE[tool])
    if program.exists():
        command = [str(program)]
    text = subprocess.run(
        [*command, "tum", truth, estimate, *arguments], capture_output=True, text=True, check=True
    ).stdout
    found = re.search(r"rmse\s+(\S+)", text)
    assert found is not None, text
    return float(found.group(1))


@pytest.mark.parametrize("with_interpolation", [True, False])
def test_evos_command_line_gives_the_same_numbers(files, with_interpolation: bool) -> None:
    options = EvaluateOptions(interpolate=with_interpolation)
    result, _ = evaluate(*files, options)
    assert result.ate is not None
    assert result.rpe_trans is not None
    assert result.rpe_rot is not None
    pair = (result.files["truth"], result.files["estimate"])
    assert result.ate.rmse == pytest.approx(evo_cli("ape", *pair, "-a"), abs=EVO_PARITY)
    ten_metres = ("--delta", "10", "--delta_unit", "m")
    assert result.rpe_trans.rmse == pytest.approx(
        evo_cli("rpe", *pair, *ten_metres), abs=EVO_PARITY
    )
    assert result.rpe_rot.rmse == pytest.approx(
        evo_cli("rpe", *pair, *ten_metres, "-r", "angle_deg"), abs=EVO_PARITY
    )
    first, _ = evaluate(*files, EvaluateOptions(interpolate=with_interpolation, align="first"))
    assert first.ate is not None
    assert first.ate.rmse == result.first_pose_ate
    assert first.ate.rmse == pytest.approx(evo_cli("ape", *pair, "--align_origin"), abs=EVO_PARITY)


def test_interpolation_removes_the_error_that_nobody_made(files) -> None:
    exact, _ = evaluate(*files)
    nearest, _ = evaluate(*files, EvaluateOptions(interpolate=False))
    assert exact.ate is not None
    assert nearest.ate is not None
    # 2 cm per axis; pairing at 20 m/s alone adds up to 10 cm, of which alignment hides most here
    # because all pairs are shifted alike.
    assert exact.ate.rmse == pytest.approx(0.02 * np.sqrt(3.0), rel=0.1)
    assert exact.max_time_diff_s == 0.0
    assert nearest.max_time_diff_s == pytest.approx(0.0047, abs=1e-6)
    assert (exact.interpolated, nearest.interpolated) == ("truth", "none")


def test_interpolated_truth_is_the_truth() -> None:
    query = stamps(10, offset_ns=3_333_333)
    found = interpolate(trajectory(stamps(100, 21.0)), query, 0.1)
    expected = trajectory(query)
    np.testing.assert_array_equal(found.stamps, query)
    np.testing.assert_allclose(found.positions, expected.positions, atol=LINEAR_ERROR_M)
    dots = np.abs((found.quaternions * expected.quaternions).sum(axis=1))
    np.testing.assert_allclose(dots, 1.0, atol=1e-8)


def test_interpolation_stays_out_of_holes_and_ends() -> None:
    whole = stamps(100)
    holed = trajectory(whole[(whole < START + 5 * NS) | (whole > START + 6 * NS)])
    query = np.array([START - 1, START + NS, START + 11 * NS // 2, START + 30 * NS])
    assert interpolate(holed, query, 0.1).stamps.tolist() == [START + NS]


def test_sparse_truth_leaves_its_stamps_and_moves_the_estimate(tmp_path: Path) -> None:
    truth = trajectory(stamps(1, offset_ns=30_000_000))
    estimate = trajectory(stamps(10))
    matched = match(truth, estimate)
    assert matched.interpolated == "estimate"
    assert set(matched.truth.stamps) <= set(truth.stamps)
    error = np.linalg.norm(matched.truth.positions - matched.estimate.positions, axis=1)
    assert error.max() < 5e-3  # 2 m/s^2 over 0.1 s


def test_first_pose_and_end_error_see_what_alignment_hides(tmp_path: Path) -> None:
    truth = trajectory(stamps(100))
    at = stamps(10, 19.9)
    bent = trajectory(at)
    turn = Rotation.from_euler("Z", np.linspace(0.0, 0.02, len(at))[:, None])
    bent = Trajectory(at, turn.apply(bent.positions), bent.quaternions)
    write(tmp_path / "e.tum", bent)
    write(tmp_path / "g.tum", truth)
    result, curves = evaluate(tmp_path / "e.tum", tmp_path / "g.tum")
    assert result.ate is not None
    assert result.end_error_m is not None
    assert curves is not None
    expected = np.linalg.norm(bent.positions[-1] - curve((at[-1:] - START) / NS)[0][0])
    assert result.end_error_m == pytest.approx(expected, rel=0.01)
    assert result.end_error_m > 3.0 * result.ate.rmse
    assert result.end_error_percent == pytest.approx(100 * result.end_error_m / truth.path_m)
    assert len(curves.t) == result.pairs


@pytest.mark.parametrize("with_interpolation", [True, False])
def test_truth_without_orientation(tmp_path: Path, with_interpolation: bool) -> None:
    at = stamps(100 if with_interpolation else 10)
    truth = trajectory(at)
    lines = [
        f"{s / NS:.9f} {x!r} {y!r} {z!r} 0 0 0 0\n"
        for s, (x, y, z) in zip(at, truth.positions.tolist(), strict=True)
    ]
    (tmp_path / "g.tum").write_text("".join(lines))
    write(tmp_path / "e.tum", moved(trajectory(stamps(10), noise=0.02)))
    assert read_tum(tmp_path / "g.tum").position_only
    result, _ = evaluate(
        tmp_path / "e.tum", tmp_path / "g.tum", EvaluateOptions(interpolate=with_interpolation)
    )
    assert result.status == "ok"
    assert result.ate is not None
    assert result.ate.rmse == pytest.approx(0.02 * np.sqrt(3.0), rel=0.1)
    assert result.rpe_rot is None
    assert result.end_error_m is None
    assert result.rpe_trans is not None
    assert result.rpe_trans.rmse < 0.1


def test_nan_poses_fail_with_the_coverage_shown(files) -> None:
    estimate, truth = files
    lines = estimate.read_text().splitlines()
    for n in range(100, 150):
        lines[n] = lines[n].split()[0] + " nan" * 7
    estimate.write_text("\n".join(lines) + "\n")
    result, curves = evaluate(estimate, truth)
    assert result.status == "fail"
    assert result.bad_poses == 50
    assert result.reason == "50 of 200 poses are not finite; coverage 74.7 %"
    assert result.coverage == pytest.approx(0.747, abs=2e-3)
    assert result.ate is None
    assert curves is None


@pytest.mark.parametrize("part", ["late", "early end", "hole"])
def test_missing_poses_fail_with_the_coverage_shown(files, part: str) -> None:
    estimate, truth = files
    whole = read_tum(estimate)
    t = (whole.stamps - START) / NS
    keep = {"late": t > 5.0, "early end": t < 15.0, "hole": (t < 8.0) | (t > 13.0)}[part]
    write(estimate, whole.select(keep))
    result, _ = evaluate(estimate, truth)
    assert result.status == "fail"
    assert "is below 95 %" in result.reason
    assert result.coverage == pytest.approx(0.75, abs=0.02)
    lenient, _ = evaluate(estimate, truth, EvaluateOptions(min_coverage=0.5))
    assert lenient.status == "ok"


def test_whole_run_covers_all() -> None:
    assert coverage(trajectory(stamps(100, 20.0)), trajectory(stamps(10, 20.0))) == 1.0


def test_no_overlap_in_time_fails(files) -> None:
    estimate, truth = files
    shifted = read_tum(estimate)
    write(estimate, Trajectory(shifted.stamps + 100 * NS, shifted.positions, shifted.quaternions))
    result, _ = evaluate(estimate, truth)
    assert (result.status, result.coverage) == ("fail", 0.0)


def test_empty_estimate_fails_but_a_missing_one_is_an_error(files, tmp_path: Path) -> None:
    estimate, truth = files
    estimate.write_text("")
    result, _ = evaluate(estimate, truth)
    assert (result.status, result.coverage) == ("fail", 0.0)
    with pytest.raises(DataError, match="cannot be read"):
        evaluate(tmp_path / "none.tum", truth)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3\n", "t.tum:1: 3 columns"),
        ("# only a comment\n", "no poses"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "t.tum:2: stamps do not grow"),
        ("1 a 0 0 0 0 0 1\n", "could not convert"),
    ],
)
def test_bad_tum_files(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "t.tum").write_text(text)
    with pytest.raises(DataError, match=said):
        read_tum(tmp_path / "t.tum")


def test_tum_stamps_are_exact_and_commas_are_read(tmp_path: Path) -> None:
    file = tmp_path / "t.tum"
    file.write_text("# t x y z\n1700000000.000000001,1,2,3,0,0,0,2\n1.7000000011e9 1 2 3 0 0 0 1\n")
    found = read_tum(file)
    assert found.stamps.tolist() == [1_700_000_000_000_000_001, 1_700_000_001_100_000_000]
    assert found.quaternions[0].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize(
    "options", [{"align": "sim3"}, {"rpe_delta": 0.0}, {"rpe_unit": "s"}, {"t_max_diff": -1.0}]
)
def test_bad_options(files, options: dict) -> None:
    with pytest.raises(ConfigError):
        evaluate(*files, EvaluateOptions(**options))


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_plot(files, tmp_path: Path, suffix: str) -> None:
    result, curves = evaluate(*files)
    assert curves is not None
    plot_curves(curves, result, tmp_path / f"p.{suffix}")
    assert (tmp_path / f"p.{suffix}").stat().st_size > 5000
    with pytest.raises(ConfigError, match="png"):
        plot_curves(curves, result, tmp_path / "p.gif")


def test_record_is_plain_json(files) -> None:
    result, _ = evaluate(*files)
    data = json.loads(result.model_dump_json())
    assert data["status"] == "ok"
    assert set(data["ate"]) == {"rmse", "mean", "median", "std", "min", "max"}
