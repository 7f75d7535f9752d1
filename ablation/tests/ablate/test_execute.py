# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""One cell in one process: its files, its limits, its failures."""

from __future__ import annotations

import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
from d2lio.ablate import execute
from d2lio.ablate.cell import CellSpec, Outcome, finished, read_outcome
from d2lio.ablate.suite import Limits
from d2lio.metrics.tum import read_tum
from d2lio.record import RunRecord

PATIENCE_S = 60.0  # for what must happen soon on a loaded machine


def spec(room: Path, host: str | None = "fastlio", **changes: Any) -> CellSpec:
    facts = {
        "sequence": "Room",
        "repeat": 0,
        "variant": host or "imported",
        "directory": f"runs/Room/r0/{host}",
        "source": str(room),
        "origin": {"kind": "simulated", "seed": 0},
        "host": host,
        "version": "0",
    }
    return CellSpec.model_validate(facts | changes)


def carry_out(cell: CellSpec, out: Path, stop: threading.Event | None = None) -> Outcome:
    return Outcome.model_validate(execute.execute(cell.model_dump(mode="json"), str(out), stop))


@pytest.fixture(autouse=True)
def _no_process_left():
    yield
    execute.close_slots()


def left_behind(out: Path) -> list[Path]:
    return [p for p in out.rglob(".*")]


def wait_until_gone(pids: list[int]) -> None:
    end = time.monotonic() + PATIENCE_S
    while any(_lives(pid) for pid in pids):
        assert time.monotonic() < end, f"still there: {pids}"
        time.sleep(0.05)


def _lives(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_a_cell_leaves_the_promised_files(room: Path, tmp_path: Path) -> None:
    cell = spec(room)
    outcome = carry_out(cell, tmp_path)
    place = tmp_path / cell.directory
    assert outcome.scores.status == "ok"
    names = {p.name for p in place.iterdir()}
    assert names == {
        "trajectory.tum",
        "diagnostics.csv",
        "run.json",
        "truth.tum",
        "trajectory.matched_truth.tum",
        "trajectory.matched_estimate.tum",
        "cell.json",
        "run.log",
    }
    assert set(outcome.matched.values()) <= names
    assert (place / "truth.tum").read_bytes() == (room / "gt.tum").read_bytes()
    record = RunRecord.load(place)
    assert outcome.scores.scans_processed == record.scans.processed
    assert outcome.scores.accepted_share == record.accepted_share
    assert outcome.scores.lambda_t_min is not None
    assert outcome.scores.lambda_t_min > 0.0
    assert outcome.costs.wall_s == record.wall_s
    assert set(outcome.costs.stages) == set(record.time_ms) - {"total"}
    assert outcome.costs.peak_memory_mb is not None
    assert outcome.costs.cpu
    assert read_outcome(place) == outcome
    assert left_behind(tmp_path) == []


def test_a_finished_cell_is_not_run_again(room: Path, tmp_path: Path) -> None:
    cell = spec(room)
    carry_out(cell, tmp_path)
    file = tmp_path / cell.directory / "cell.json"
    before = file.stat()
    carry_out(cell, tmp_path)
    assert file.stat() == before


@pytest.mark.parametrize(
    "change",
    [
        {"params": {"degeneracy.w": "1"}},
        {"rejection": "kiss"},
        {"version": "1"},
        {"origin": {"kind": "simulated", "seed": 1}},
        {"start_offset_s": 1.0},
        {"threads": 2},
        {"limits": Limits(time_s=5.0)},
        {"peer_version": "2"},
        {"imported_hash": "abc"},
    ],
)
def test_another_specification_is_another_result(
    room: Path, tmp_path: Path, change: dict[str, Any]
) -> None:
    cell = spec(room)
    place = tmp_path / cell.directory
    place.mkdir(parents=True)
    outcome = Outcome.model_validate({"digest": cell.digest(), "scores": {"status": "ok"}})
    (place / "cell.json").write_text(outcome.model_dump_json())
    assert finished(tmp_path, cell) == outcome
    assert finished(tmp_path, cell.model_copy(update={"source": "/elsewhere"})) == outcome
    assert finished(tmp_path, cell.model_copy(update=change)) is None
    (place / "cell.json").write_text(outcome.model_dump_json()[:-5])
    assert finished(tmp_path, cell) is None


@pytest.mark.parametrize(
    ("host", "reason"),
    [("crash", "crashed (SIGSEGV)"), ("raise", "internal error: RuntimeError: a bug")],
)
def test_a_crash_is_a_failed_row(
    room: Path, tmp_path: Path, plugin_hosts: None, host: str, reason: str
) -> None:
    outcome = carry_out(spec(room, host), tmp_path)
    assert (outcome.scores.status, outcome.scores.reason) == ("fail", reason)
    assert outcome.scores.ate_m is None
    assert finished(tmp_path, spec(room, host)) == outcome
    # The same process that starts runs goes on with the next one.
    assert carry_out(spec(room), tmp_path).scores.status == "ok"
    assert left_behind(tmp_path) == []


def test_divergence_is_a_failed_row(room: Path, tmp_path: Path, plugin_hosts: None) -> None:
    cell = spec(room, "fake", params={"fake.nan_at": "4"})
    outcome = carry_out(cell, tmp_path)
    assert outcome.scores.status == "fail"
    assert outcome.scores.reason == "diverged: pose 4 is not finite"
    assert outcome.scores.coverage is not None
    assert (tmp_path / cell.directory / "run.json").exists()


def test_an_error_beyond_five_percent_fails_and_is_kept(
    room: Path, tmp_path: Path, plugin_hosts: None
) -> None:
    scores = carry_out(spec(room, "astray"), tmp_path).scores
    assert scores.status == "fail"
    assert scores.ate_percent is not None
    assert scores.ate_percent > 5.0
    assert scores.reason == f"ATE {scores.ate_percent:.1f} % of the path, beyond 5 %"
    assert scores.ate_m is not None


def test_a_refused_configuration_is_a_failed_row(room: Path, tmp_path: Path) -> None:
    outcome = carry_out(spec(room, params={"rejection.tau": "-3"}), tmp_path)
    assert outcome.scores.status == "fail"
    assert "rejection.tau" in outcome.scores.reason


def test_a_run_that_hangs_ends_with_all_its_processes(
    room: Path, tmp_path: Path, plugin_hosts: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HANG_PIDS", str(tmp_path / "pids"))
    outcome = carry_out(spec(room, "hang", limits=Limits(time_s=5.0)), tmp_path)
    assert outcome.scores.reason == "took longer than 5 s"
    wait_until_gone([int(pid) for pid in (tmp_path / "pids").read_text().split()])


def test_memory_of_child_processes_counts(room: Path, tmp_path: Path, plugin_hosts: None) -> None:
    outcome = carry_out(spec(room, "hog", limits=Limits(memory_mb=250.0)), tmp_path)
    assert outcome.scores.reason == "used more than 250 MB of memory"
    assert outcome.costs.peak_memory_mb is not None
    assert outcome.costs.peak_memory_mb > 250.0


def test_a_run_ended_from_outside_is_no_result(
    room: Path, tmp_path: Path, plugin_hosts: None
) -> None:
    cell = spec(room, "terminated")
    with pytest.raises(execute.NotCarriedOutError, match="SIGTERM"):
        carry_out(cell, tmp_path)
    assert not (tmp_path / cell.directory).exists()
    assert left_behind(tmp_path) == []


def test_stopping_ends_the_run_and_leaves_nothing(
    room: Path, tmp_path: Path, plugin_hosts: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    pids = tmp_path / "pids"
    monkeypatch.setenv("HANG_PIDS", str(pids))
    stop = threading.Event()

    def stop_once_it_hangs() -> None:
        end = time.monotonic() + PATIENCE_S
        while not (pids.exists() and pids.read_text()) and time.monotonic() < end:
            time.sleep(0.02)
        stop.set()

    waiter = threading.Thread(target=stop_once_it_hangs)
    waiter.start()
    with pytest.raises(execute.StoppedError):
        carry_out(spec(room, "hang"), tmp_path / "out", stop)
    waiter.join()
    wait_until_gone([int(pid) for pid in pids.read_text().split()])
    assert left_behind(tmp_path / "out") == []


def test_a_missing_sequence_is_no_result(room: Path, tmp_path: Path) -> None:
    with pytest.raises(execute.NotCarriedOutError, match="not there"):
        carry_out(spec(tmp_path / "gone"), tmp_path)


def test_a_sequence_that_cannot_be_made_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(execute.NotCarriedOutError, match="simulation: duration"):
        execute.make_sequence({"scene": "room", "duration": 1e6}, str(tmp_path / "seq"))
    assert list(tmp_path.iterdir()) == []


def test_a_sequence_is_made_once(room: Path, tmp_path: Path) -> None:
    request = {"scene": "room", "duration": 1.0}
    execute.make_sequence(request, str(tmp_path / "seq"))
    made = (tmp_path / "seq" / "data.bag").stat()
    assert execute.make_sequence(request, str(tmp_path / "seq")) == {"seconds": 0.0}
    assert (tmp_path / "seq" / "data.bag").stat() == made
    assert [p.name for p in tmp_path.iterdir()] == ["seq"]


def test_an_imported_trajectory_is_scored(room: Path, tmp_path: Path) -> None:
    run = carry_out(spec(room), tmp_path)
    file = tmp_path / "given.tum"
    file.write_bytes((tmp_path / spec(room).directory / "trajectory.tum").read_bytes())
    cell = spec(
        room,
        None,
        variant="mine",
        directory="runs/Room/r0/mine",
        imported=str(file),
        imported_hash="x",
    )
    outcome = carry_out(cell, tmp_path)
    assert outcome.scores.ate_m == pytest.approx(run.scores.ate_m, abs=1e-9)
    assert outcome.scores.scans_read is None
    assert len(read_tum(tmp_path / cell.directory / "trajectory.tum")) > 1


def test_the_log_has_what_the_run_said(room: Path, tmp_path: Path, plugin_hosts: None) -> None:
    cell = spec(room, "raise")
    carry_out(cell, tmp_path)
    assert "Traceback" in (tmp_path / cell.directory / "run.log").read_text()


def test_results_do_not_depend_on_where_the_run_happened(room: Path, tmp_path: Path) -> None:
    first = carry_out(spec(room), tmp_path / "a")
    second = carry_out(spec(room), tmp_path / "b")
    assert first.scores == second.scores
    cells = [json.loads((tmp_path / n / spec(room).directory / "cell.json").read_text())
             for n in "ab"]  # fmt: skip
    assert cells[0]["digest"] == cells[1]["digest"]
    assert str(os.getpid()) not in cells[0]["scores"]["reason"]
