# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Suites on recordings: what is found below --data, ground truth, start offsets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tiny
from bags import NS, START
from d2lio.ablate.ablation import AblateOptions, Ablation, ablate
from d2lio.ablate.sequences import find_recorded
from d2lio.errors import ConfigError, DataError
from d2lio.metrics.tum import Trajectory, read_tum, write
from d2lio.record import RunRecord
from known_bags import SCANS, write_known

OFFSET_S = 0.5


def truth_file(path: Path, *, position_only: bool = False, seconds: float = 2.2) -> Path:
    """A slow straight drive at 20 Hz from the bags' start on."""
    path.parent.mkdir(parents=True, exist_ok=True)
    stamps = START + np.arange(int(seconds * 20), dtype=np.int64) * (NS // 20)
    positions = np.zeros((len(stamps), 3))
    positions[:, 0] = 0.01 * np.arange(len(stamps))
    quaternions = np.zeros((len(stamps), 4))
    quaternions[:, 3] = 0.0 if position_only else 1.0
    write(path, Trajectory(stamps, positions, quaternions))
    return path


def suite_of(*names: str, **changes):
    sequences = [
        {"name": f"Row {i}", "dataset": "GEODE", "recording": name} for i, name in enumerate(names)
    ]
    base = {"sequences": sequences, "variants": [tiny.FASTLIO], "offset_step_s": OFFSET_S}
    return tiny.suite(**(base | changes))


def run(suite, out: Path, data: Path) -> Ablation:
    return ablate(suite, out, AblateOptions(data=data), tiny.Memory())


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Offroad3_beta with truth beside it, Tunneling_tunnel2_alpha with positions only."""
    root = tmp_path / "data"
    write_known(root / "GEODE" / "Offroad3_beta.bag", "beta")
    truth_file(root / "GEODE" / "Offroad3_beta.txt")
    write_known(root / "GEODE" / "Tunneling_tunnel2_alpha.bag", "alpha")
    truth_file(root / "GEODE" / "Tunneling_tunnel2_alpha.txt", position_only=True)
    (root / "notes.txt").write_text("x")
    return root


def test_recordings_are_found_by_the_name_of_their_sequence(data: Path) -> None:
    wanted = ["Offroad3_beta", "Offroad1_alpha", "Tunneling_tunnel2_alpha"]
    found = find_recorded(data, wanted)
    assert {name: path.name for name, path in found.items()} == {
        "Offroad3_beta": "Offroad3_beta.bag",
        "Tunneling_tunnel2_alpha": "Tunneling_tunnel2_alpha.bag",
    }


def test_repeats_begin_later_and_so_does_the_truth(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    ablation = run(suite_of("Offroad3_beta", repeats=3), out, data)
    assert ablation.problems == {}
    rows = ablation.results.rows
    assert [row.start_offset_s for row in rows] == [0.0, OFFSET_S, 2 * OFFSET_S]
    assert {row.seed for row in rows} == {None}
    assert {(row.scene, row.sensor) for row in rows} == {("", "")}
    begins = []
    for row in rows:
        record = RunRecord.load(out / row.directory)
        assert record.start_offset_s == row.start_offset_s
        truth = read_tum(out / row.directory / "truth.tum")
        begins.append(int(truth.stamps[0]))
        if record.start_stamp_ns is not None:
            assert truth.stamps[0] >= record.start_stamp_ns
            assert truth.stamps[0] - record.start_stamp_ns < NS // 20
    assert begins == sorted(set(begins))
    dropped = [RunRecord.load(out / row.directory).scans.dropped for row in rows]
    before = [counts.get("before_start", 0) for counts in dropped]
    assert before[0] == 0 < before[1] < before[2] < SCANS


def test_position_only_truth_stays_so(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    ablation = run(suite_of("Tunneling_tunnel2_alpha"), out, data)
    for row in ablation.results.rows:
        assert read_tum(out / row.directory / "truth.tum").position_only
        assert row.coverage is not None
        assert row.rpe_rot_deg is None


def test_an_estimate_is_moved_to_where_positions_were_measured(data: Path, tmp_path: Path) -> None:
    bag = write_known(data / "GEODE" / "Tunneling_tunnel2_beta.bag", "beta")
    truth_file(bag.with_suffix(".txt"), position_only=True)
    out = tmp_path / "out"
    ablation = run(suite_of("Tunneling_tunnel2_beta", repeats=1), out, data)
    place = out / ablation.results.rows[0].directory
    own, moved = (read_tum(place / f"trajectory{s}.tum") for s in ("", ".at_truth"))
    lever = np.linalg.norm(own.positions - moved.positions, axis=1)
    assert lever == pytest.approx(0.5404, abs=2e-3)  # |t| of T_gt_imu of beta


def test_the_first_recording_that_is_there_is_used(data: Path, tmp_path: Path) -> None:
    names = ["Offroad3_alpha", "Offroad3_beta"]
    sequence = {"name": "Offroad-3", "recording": names, "simulate": tiny.ROOM}
    ablation = run(suite_of(sequences=[sequence], repeats=1), tmp_path / "out", data)
    notes = RunRecord.load(tmp_path / "out" / ablation.results.rows[0].directory).inputs
    assert notes == ["Offroad3_beta.bag"]


def test_missing_recordings_are_listed_and_left_out(data: Path, tmp_path: Path) -> None:
    suite = suite_of("Offroad3_beta", "Offroad1_alpha", repeats=1)
    ablation = run(suite, tmp_path / "out", data)
    assert [row.sequence for row in ablation.results.rows] == ["Row 0"]
    assert any("Row 1" in note and "Offroad1_alpha" in note for note in ablation.results.notes)


def test_no_recording_at_all_is_refused(data: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="Offroad1_alpha"):
        run(suite_of("Offroad1_alpha"), tmp_path / "out", data)
    with pytest.raises(DataError, match="no such file"):
        run(suite_of("Offroad1_alpha"), tmp_path / "out", data / "nowhere")


def test_without_data_a_recording_is_left_out_with_a_note(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="needs --data"):
        ablate(suite_of("Offroad3_beta"), tmp_path / "out", AblateOptions(), tiny.Memory())


def test_a_recording_without_truth_is_a_failed_row(data: Path, tmp_path: Path) -> None:
    (data / "GEODE" / "Offroad3_beta.txt").unlink()
    ablation = run(suite_of("Offroad3_beta", repeats=1), tmp_path / "out", data)
    row = ablation.results.rows[0]
    assert row.status == "fail"
    assert "no ground truth found" in row.reason
