# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The runner: counts, files, divergence, interruption, refusal."""

from __future__ import annotations

import csv
import errno
from pathlib import Path

import numpy as np
import pytest
from bags import NS, START, cloud_message, drive, ros1_store, velodyne_points, write_bag
from d2lio.cli import app
from d2lio.datasets import open_source
from d2lio.datasets.source import Source
from d2lio.errors import ConfigError, DataError
from d2lio.output import OutputDir, ResultWriter, tum_line
from d2lio.record import RunRecord
from d2lio.runner import Interrupted, RunOptions, run
from typer.testing import CliRunner

SCANS = 8


@pytest.fixture
def source(tmp_path: Path) -> Source:
    path = write_bag(tmp_path / "a.bag", drive(SCANS))
    config = tmp_path / "c.yaml"
    config.write_text("name: short\nlidar: {rings: 16, min_range_m: 0.7, max_range_m: 80}\n")
    return open_source(path, config)


def test_three_files_and_every_scan_accounted_for(
    source: Source, tmp_path: Path, fake_host
) -> None:
    out = tmp_path / "out"
    options = RunOptions(host=fake_host, rejection="kiss", command=["run", "x"])
    told = []
    record = run(source, options, out, lambda done, total: told.append((done, total)))
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnostics.csv",
        "run.json",
        "trajectory.tum",
    ]
    assert record == RunRecord.load(out)
    assert record.status == "complete"
    assert record.scans.read == SCANS
    assert record.scans.processed + sum(record.scans.dropped.values()) == SCANS
    assert record.scans.dropped == {"no_pose_ok": 1}
    assert record.params["rejection.mode"] == "kiss"
    assert record.params["preprocess.blind"] == "0.7"
    assert record.params["fake.nan_at"] == "-1"
    assert record.accepted_share == pytest.approx(0.8)
    assert record.time_ms["total"].max == pytest.approx(SCANS)
    assert record.path_m == pytest.approx(2.0 * 0.1 * (SCANS - 2), rel=1e-6)
    assert record.peak_memory_mb > 1.0
    assert told[-1] == (SCANS, SCANS)
    rows = list(csv.DictReader((out / "diagnostics.csv").open()))
    assert len(rows) == SCANS
    lines = (out / "trajectory.tum").read_text().splitlines()
    assert len(lines) == SCANS - 1
    # Scan ends: stamp plus the last point's time, with nine decimals.
    assert lines[0].split()[0] == rows[1]["stamp_ns"][:10] + "." + rows[1]["stamp_ns"][10:]


def test_same_inputs_same_hash(source: Source, tmp_path: Path, fake_host) -> None:
    first = run(source, RunOptions(host=fake_host), tmp_path / "1")
    again = open_source(tmp_path / "a.bag", tmp_path / "c.yaml")
    second = run(again, RunOptions(host=fake_host), tmp_path / "2")
    assert first.inputs_hash == second.inputs_hash
    one, two = (tmp_path / n / "trajectory.tum" for n in ("1", "2"))
    assert one.read_bytes() == two.read_bytes()


def test_max_scans(source: Source, tmp_path: Path, fake_host) -> None:
    record = run(source, RunOptions(host=fake_host, max_scans=3), tmp_path / "out")
    assert record.scans.processed == 2
    assert record.scans.dropped["no_pose_ok"] == 1


def test_pose_that_is_not_finite_is_divergence(source: Source, tmp_path: Path, fake_host) -> None:
    options = RunOptions(host=fake_host, params={"fake.nan_at": "4"})
    record = run(source, options, tmp_path / "out")
    assert record.status == "diverged"
    assert "pose 4 is not finite" in record.reason
    assert "nan" in (tmp_path / "out" / "trajectory.tum").read_text()


def test_interruption_leaves_a_marked_partial(source: Source, tmp_path: Path, fake_host) -> None:
    out = tmp_path / "out"
    options = RunOptions(host=fake_host, params={"fake.interrupt_at": "5"})
    with pytest.raises(Interrupted) as caught:
        run(source, options, out)
    assert not out.exists()
    assert caught.value.partial == tmp_path / "out.partial"
    record = RunRecord.load(caught.value.partial)
    assert record.status == "interrupted"
    assert record.scans.processed == 4
    finished = run(open_source(tmp_path / "a.bag", tmp_path / "c.yaml"),
                   RunOptions(host=fake_host), out)  # fmt: skip
    assert finished.status == "complete"
    assert not caught.value.partial.exists()
    assert [p for p in tmp_path.iterdir() if p.name.startswith(".")] == []


def test_no_scan_in_time_is_a_failed_run(tmp_path: Path, fake_host) -> None:
    messages = [m for m in drive(1)]
    source = open_source(write_bag(tmp_path / "a.bag", messages))
    record = run(source, RunOptions(host=fake_host), tmp_path / "out")
    assert (record.status, record.reason) == ("failed", "no scan gave a pose")


def test_damaged_input_leaves_nothing(tmp_path: Path, fake_host) -> None:
    messages = drive(4)
    bad = cloud_message(ros1_store(), START + NS, velodyne_points(8))
    bad.width = 9
    messages[-1].topic, messages[-1].msgtype = "/lidar/points", "sensor_msgs/msg/PointCloud2"
    messages[-1].message = bad
    source = open_source(write_bag(tmp_path / "a.bag", messages))
    with pytest.raises(DataError, match="claims 1 x 9 points"):
        run(source, RunOptions(host=fake_host), tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.bag"]


def test_unknown_host_and_bad_threads(source: Source, tmp_path: Path, fake_host) -> None:
    with pytest.raises(ConfigError, match="host = 'fast'"):
        run(source, RunOptions(host="fast"), tmp_path / "out")
    with pytest.raises(ConfigError, match="threads = 0"):
        run(source, RunOptions(host=fake_host, threads=0), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_existing_directory_that_is_no_run_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "thesis"
    target.mkdir()
    (target / "chapter1.tex").write_text("x")
    with pytest.raises(DataError, match="is not a run"):
        OutputDir(target)
    assert (target / "chapter1.tex").exists()


def test_tum_line_holds_every_digit() -> None:
    pose = np.eye(4)
    pose[:3, 3] = [1 / 3, -2e-17, 1e5 / 7]
    cells = tum_line(1_700_000_000_000_000_001, pose).split()
    assert cells[0] == "1700000000.000000001"
    assert [float(c) for c in cells[1:4]] == [1 / 3, -2e-17, 1e5 / 7]
    assert [float(c) for c in cells[4:]] == [0, 0, 0, 1]


def test_full_disk_ends_in_one_line_and_leaves_nothing(
    source: Source, tmp_path: Path, fake_host, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ResultWriter, "add", full)
    before = sorted(p.name for p in tmp_path.iterdir())
    result = CliRunner().invoke(
        app, ["run", str(tmp_path / "a.bag"), "--host", fake_host, "--out", str(tmp_path / "o")]
    )
    assert result.exit_code == 3
    assert result.stderr.splitlines()[-1].startswith("error: the disk is full")
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_start_offset_leaves_out_what_comes_before(
    source: Source, tmp_path: Path, fake_host
) -> None:
    whole = run(source, RunOptions(host=fake_host), tmp_path / "whole")
    later = open_source(tmp_path / "a.bag", tmp_path / "c.yaml")
    options = RunOptions(host=fake_host, start_offset_s=0.45)
    record = run(later, options, tmp_path / "later")
    assert whole.start_stamp_ns is None
    assert record.start_stamp_ns is not None
    assert record.start_offset_s == 0.45
    stamps = [
        [int(row["stamp_ns"]) for row in csv.DictReader((tmp_path / n / "diagnostics.csv").open())]
        for n in ("whole", "later")
    ]
    # The IMU begins 0.2 s before the first scan: scans at 0, 0.1 and 0.2 s lie before the start.
    assert record.start_stamp_ns == START + NS // 4
    assert record.scans.dropped["before_start"] == 3
    assert stamps[1] == stamps[0][3:]
    assert record.scans.read == SCANS
    assert record.scans.processed + sum(record.scans.dropped.values()) == SCANS


@pytest.mark.parametrize("offset", [-1.0, float("nan"), float("inf")])
def test_start_offset_that_makes_no_sense(
    source: Source, tmp_path: Path, fake_host, offset: float
) -> None:
    with pytest.raises(ConfigError, match="start-offset"):
        run(source, RunOptions(host=fake_host, start_offset_s=offset), tmp_path / "out")


def test_start_beyond_the_end_is_a_failed_run(source: Source, tmp_path: Path, fake_host) -> None:
    record = run(source, RunOptions(host=fake_host, start_offset_s=1e4), tmp_path / "out")
    assert (record.status, record.reason) == ("failed", "no scan gave a pose")
    assert record.scans.dropped["before_start"] == SCANS
