# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What `d2lio bench` makes of its figures; the street of the long drive. Nothing is timed here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from built import needs_gtsam
from d2lio import bench_drive, bench_summary
from d2lio.bench_drive import Drive, growth, verdict
from d2lio.bench_street import (
    COLUMNS,
    HOUSE_HEIGHT_M,
    MAX_RANGE_M,
    POST_DISTANCE_M,
    POST_RADIUS_M,
    RANGE_NOISE_M,
    RINGS,
    SETBACK_M,
    Street,
)

SIGMAS = 5.0


@pytest.fixture(scope="module")
def street() -> Street:
    return Street(60.0)


def _in_world(street: Street, index: int) -> np.ndarray:
    stamp, xyz, dt_ns, _ = street.scan(index)
    position, rotation = street.trajectory.pose((stamp + dt_ns.astype(np.int64)) * 1e-9)
    return position + np.einsum("nij,nj->ni", rotation, xyz)


@pytest.mark.parametrize("index", [0, 150, 550])
def test_points_lie_on_the_street_when_deskewed_with_the_truth(street: Street, index: int) -> None:
    world = _in_world(street, index)
    slack = SIGMAS * RANGE_NOISE_M
    assert len(world) > 0.5 * RINGS * COLUMNS
    assert world[:, 2].min() > -slack
    assert world[:, 2].max() < HOUSE_HEIGHT_M + slack
    side = np.abs(world[:, 1])
    assert side.max() < SETBACK_M[1] + slack
    ground = np.abs(world[:, 2]) < slack
    front = np.zeros(len(world), bool)
    for houses in street._sides:
        own = np.sign(world[:, 1]) == houses.sign
        k = np.clip(np.searchsorted(houses.walls, world[:, 0], "right") - 1, 0, None)
        front |= own & (np.abs(side - houses.fronts[k]) < slack)
        nearest = np.abs(world[:, :1] - houses.walls).min(axis=1)
        front |= own & (nearest < slack) & (side > SETBACK_M[0] - slack)
    post = np.abs(side - POST_DISTANCE_M) < POST_RADIUS_M + slack
    assert np.mean(ground | front | post) > 0.999
    assert 0.1 < ground.mean() < 0.8
    assert (post & ~ground).sum() > 3
    assert front.mean() > 0.1


def test_scans_stay_within_range_and_in_order(street: Street) -> None:
    stamp, xyz, dt_ns, ring = street.scan(300)
    assert (xyz.dtype, dt_ns.dtype, ring.dtype) == (np.float32, np.int32, np.uint16)
    assert stamp == 30_000_000_000
    assert np.all(np.diff(dt_ns) >= 0)
    assert 0 <= dt_ns.min() <= dt_ns.max() < 100_000_000
    assert np.linalg.norm(xyz, axis=1).max() < MAX_RANGE_M + SIGMAS * RANGE_NOISE_M
    assert np.array_equal(np.unique(ring), np.arange(RINGS))


def test_the_imu_covers_the_drive_at_100_hz(street: Street) -> None:
    assert np.all(np.diff(street.imu_stamps) == 10_000_000)
    assert street.imu_stamps[-1] >= street.scans * 100_000_000
    assert np.median(street.accel[:, 2]) == pytest.approx(9.81, abs=0.2)


def test_growth_compares_the_last_third_with_all_before_it() -> None:
    assert growth([1.0, 5.0, 9.0, 10.0, 10.0, 9.0, 10.2, 10.1, 9.9]) == pytest.approx(0.02)
    assert growth([float(i) for i in range(1, 31)]) == pytest.approx(0.5)
    assert growth([1.0, 1.0]) == float("inf")


def _drive(map_mb: list[float], drift: float = 0.01) -> Drive:
    n = len(map_mb)
    return Drive(
        "d2lio", [float(i) for i in range(n)], map_mb, [100.0] * n, [5.0] * n,
        [0.01] * (n - 1) + [drift], 600 * n, 9000.0,
    )  # fmt: skip


def test_verdict() -> None:
    steady = [5.0, 40.0, 50.0, 50.0, 51.0, 51.0]
    assert verdict(_drive(steady)).startswith("memory: PASS, bounded: map 5 -> 51 MB (peak 51")
    assert "FAIL, growing" in verdict(_drive([float(i) for i in range(1, 10)]))
    assert "got lost" in verdict(_drive(steady, drift=0.2))


def test_half_the_scan_period() -> None:
    entry = {
        "name": "BM_ScanD2Lio/speed:8/iterations:60/manual_time",
        **{f"{stage}_ms": 3.0 for stage in bench_summary.STAGES},
        "mean_ms": 20.0, "p95_ms": 25.0, "cpu_ms": 19.0,
    }  # fmt: skip
    off = entry | {"name": "BM_ScanD2LioOff/speed:8/iterations:60/manual_time", "mean_ms": 90.0}
    lost = entry | {"error_occurred": True, "error_message": "the estimate left the street"}
    (line,) = bench_summary.period_share([entry, off])
    assert "at 8 m/s: PASS: 20.0 ms on one core (19.0 ms of CPU time) is 0.40 of half" in line
    assert "FAIL" in bench_summary.period_share([entry | {"mean_ms": 55.0}])[0]
    assert "FAIL: the estimate left the street" in bench_summary.period_share([lost])[0]
    assert "not measured" in bench_summary.period_share([])[0]
    assert bench_summary.street_table([entry, off, lost]).row_count == 3


def test_cost_of_noise_aware_by_scene() -> None:
    entries = [
        {
            "name": f"BM_NoiseAwareCost/pipe:{radius}/iterations:300/repeats:5",
            "share_percent": share,
        }
        for radius, share in ((0, 7.0), (0, 9.0), (0, 8.0), (3, 14.0))
    ]
    room, tunnel = bench_summary.noise_aware_cost(entries)
    assert "room: 8.0 % of search and update on top (median of 3, 7.0 … 9.0" in room
    assert "vaulted tunnel: 14.0 %" in tunnel
    assert all("not measured" in line for line in bench_summary.noise_aware_cost([]))


@needs_gtsam
def test_a_short_drive_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "drive.json"
    assert bench_drive.main(["--minutes", "0.3", "--out", str(out)]) == 0
    drive = json.loads(out.read_text())
    assert drive["scans"] >= 170
    assert max(drive["drift"]) < 0.02
    assert drive["path_m"] > 100.0
    assert len(drive["minutes"]) == len(drive["rss_mb"]) == len(drive["map_mb"]) == 1
    assert "memory:" in capsys.readouterr().out


def test_without_gtsam_the_drive_is_left_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from d2lio import hosts

    monkeypatch.setattr(hosts, "LIOSAM_MODULE", "d2lio._no_such_module")
    assert bench_drive.main(["--minutes", "1"]) == 0
    assert "left out" in capsys.readouterr().out
