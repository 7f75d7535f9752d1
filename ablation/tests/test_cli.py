# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The commands as a user calls them: output, JSON, exit codes, one-line errors."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bags import drive, write_bag
from built import host_params, needs_gtsam
from d2lio import hosts
from d2lio.cli import app
from d2lio.jobs import d2lio_command, run_process
from d2lio.record import RunRecord
from typer.testing import CliRunner

TRAJECTORY_ERROR_M = 0.02  # 2 s of standstill and slow motion in the room
DONE, USAGE, DATA, FAILED, INTERRUPTED = 0, 2, 3, 4, 130


def d2lio(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = d2lio_command(*map(str, arguments))
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def in_process(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The same without a process of its own, for commands that end at once."""
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    return subprocess.CompletedProcess([], result.exit_code, result.stdout, result.stderr)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sequences") / "room"
    done = d2lio("simulate", "room", "--duration", "4", "--seed", "3", "--out", path, "--json")
    assert done.returncode == DONE, done.stderr
    assert json.loads(done.stdout)["path"] == str(path)
    return path


@pytest.fixture(scope="module")
def finished(sequence: Path) -> Path:
    out = sequence.parent / "run"
    done = d2lio("run", sequence, "--rejection", "point_adaptive", "--out", out, "--json")
    assert done.returncode == DONE, done.stderr
    assert RunRecord.model_validate_json(done.stdout) == RunRecord.load(out)
    return out


def one_line_error(done: subprocess.CompletedProcess[str], code: int) -> str:
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    errors = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return errors[0]


def test_run_accounts_for_every_scan(finished: Path) -> None:
    record = RunRecord.load(finished)
    assert record.status == "complete"
    assert record.host_counts["scans_accepted"] == record.scans.read
    assert record.scans.processed + sum(record.scans.dropped.values()) == record.scans.read
    assert record.params["rejection.mode"] == "point_adaptive"
    assert len((finished / "trajectory.tum").read_text().splitlines()) == record.scans.processed
    assert 0.0 < record.time_ms["total"].median <= record.time_ms["total"].p95
    assert record.command[0] == "run"


def test_evaluate(sequence: Path, finished: Path) -> None:
    done = d2lio("evaluate", finished, sequence / "gt.tum", "--json", "--plot", finished / "p.svg")
    assert done.returncode == DONE, done.stderr
    result = json.loads(done.stdout)
    assert result["ate"]["rmse"] < TRAJECTORY_ERROR_M
    assert result["coverage"] > 0.9
    assert (finished / "p.svg").exists()
    shown = d2lio("evaluate", finished, sequence / "gt.tum").stdout
    assert "ATE RMSE (se3)" in shown


def test_threads_and_repeats_change_no_byte(sequence: Path, tmp_path: Path) -> None:
    texts = []
    for name, threads in (("a", 1), ("b", 2), ("c", 1)):
        out = tmp_path / name
        assert d2lio("run", sequence, "--threads", threads, "--out", out).returncode == DONE
        texts.append((out / "trajectory.tum").read_bytes())
    assert texts[0] == texts[1] == texts[2]


def test_prior_and_set_reach_the_host(sequence: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    done = d2lio("run", sequence, "--degeneracy", "paper", "--set", "degeneracy.w=7",
                 "--max-scans", 12, "--out", out)  # fmt: skip
    assert done.returncode == DONE, done.stderr
    record = RunRecord.load(out)
    assert record.params["degeneracy.method"] == "paper"
    assert record.params["degeneracy.w"] == "7"
    assert record.scans.processed <= 12


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--set", "rejection.tua=1"], USAGE, "rejection.tua"),
        (["--set", "rejection.tau=-1"], USAGE, "rejection.tau"),
        (["--set", "filter_size_surf=nan"], USAGE, "filter_size_surf"),
        (["--set", "rejection.tau"], USAGE, "key=value"),
        (["--rejection", "kis"], USAGE, "point_adaptive"),
        (["--degeneracy", "papre"], USAGE, "remap"),
        (["--host", "fast_lio"], USAGE, "fastlio"),
        (["--stamps", "arrival"], USAGE, "header, log"),
    ],
)
def test_refused_configuration(
    sequence: Path, tmp_path: Path, arguments: list[str], code: int, said: str
) -> None:
    done = in_process("run", sequence, "--out", tmp_path / "o", *arguments)
    assert said in one_line_error(done, code)
    assert not (tmp_path / "o").exists()


def test_refused_input(tmp_path: Path) -> None:
    assert "no such file" in one_line_error(in_process("run", tmp_path / "no.bag"), DATA)
    (tmp_path / "bad.bag").write_text("nothing\n")
    assert "cannot be opened" in one_line_error(in_process("run", tmp_path / "bad.bag"), DATA)
    (tmp_path / "sequence.yaml").write_text("name: x\nspeed: 3\n")
    assert "speed" in one_line_error(in_process("run", tmp_path), USAGE)


def test_run_without_any_pose_fails_with_its_reason(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.bag", drive(1))
    done = d2lio("run", bag, "--out", tmp_path / "o", "--json")
    assert done.returncode == FAILED
    assert json.loads(done.stdout)["status"] == "failed"
    assert "no scan gave a pose" in done.stderr


def test_interrupted_run_is_marked(sequence: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    process = subprocess.Popen(
        d2lio_command("run", str(sequence), "--out", str(out)), stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 300.0
    while not any(tmp_path.glob(".o-*/trajectory.tum")) and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    if process.returncode == DONE:
        pytest.skip("the run ended before the signal came")
    # Where the signal comes while a library compiles code of its own, CPython ends itself by SIGINT
    # although the interrupt was handled; a shell calls both 130.
    assert process.returncode in (INTERRUPTED, -signal.SIGINT), said
    assert "o.partial" in said
    assert RunRecord.load(tmp_path / "o.partial").status == "interrupted"
    assert not out.exists()


def test_evaluate_exit_codes(sequence: Path, finished: Path, tmp_path: Path) -> None:
    truth = sequence / "gt.tum"
    lines = (finished / "trajectory.tum").read_text().splitlines(keepends=True)
    (tmp_path / "half.tum").write_text("".join(lines[: len(lines) // 2]))
    done = d2lio("evaluate", tmp_path / "half.tum", truth, "--json")
    assert done.returncode == FAILED
    assert json.loads(done.stdout)["ate"] is None
    assert "coverage" in done.stderr
    assert "align" in one_line_error(in_process("evaluate", finished, truth, "--align", "x"), USAGE)
    assert "gt.txt" in one_line_error(in_process("evaluate", finished, tmp_path / "gt.txt"), DATA)


def test_simulate_names_its_choices(tmp_path: Path) -> None:
    error = one_line_error(in_process("simulate", "tunel", "--out", tmp_path / "o"), USAGE)
    assert "tunnel_cabinets" in error
    listed = json.loads(in_process("simulate", "list", "--json").stdout)
    assert {"tunnel", "room", "offroad"} <= set(listed["scenes"])
    assert "vlp16" in listed["sensors"]
    assert "vlp16" in in_process("simulate", "list").stdout


def test_params_in_three_forms() -> None:
    entries = json.loads(in_process("params", "--json").stdout)
    keys = [entry["key"] for entry in entries]
    assert {"rejection.mode", "degeneracy.w", "filter_size_surf"} <= set(keys)
    page = in_process("params", "--markdown").stdout
    assert all(f"| `{key}` |" in page for key in keys)
    assert "## rejection" in page
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert all(row.replace("\\|", "").count("|") == 7 for row in rows)
    assert "rejection.mode" in in_process("params").stdout


@needs_gtsam
def test_params_of_all_hosts() -> None:
    by_host = json.loads(in_process("params", "--host", "all", "--json").stdout)
    assert list(by_host) == ["fastlio", "liosam", "d2lio"]
    page = in_process("params", "--host", "all", "--markdown").stdout
    keys = {entry["key"] for entries in by_host.values() for entry in entries}
    assert all(f"| `{key}` |" in page for key in keys)
    assert "host d2lio" in in_process("params", "--host", "d2lio").stdout


@pytest.mark.parametrize("host", host_params(("liosam", "d2lio")))
def test_run_with_another_host(sequence: Path, tmp_path: Path, host: str) -> None:
    out = tmp_path / "o"
    done = in_process("run", sequence, "--host", host, "--max-scans", 12, "--out", out, "--json")
    assert done.returncode == DONE, done.stderr
    record = RunRecord.load(out)
    assert record.host == host
    assert record.params["N_SCAN"] == "16"
    assert record.scans.processed >= 4


def test_a_host_that_is_not_built_is_one_line(
    sequence: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hosts, "LIOSAM_MODULE", "d2lio._no_such_module")
    done = in_process("run", sequence, "--host", "liosam", "--out", tmp_path / "o")
    assert "without GTSAM" in one_line_error(done, DATA)
    assert "without GTSAM" in one_line_error(in_process("params", "--host", "all"), DATA)


def test_help_and_version_name_exit_codes() -> None:
    done = d2lio("--help")
    assert done.returncode == DONE
    assert "130 interrupted" in " ".join(done.stdout.replace("│", " ").split())
    assert d2lio("--version").stdout.startswith("d2lio ")
    assert d2lio("runn").returncode == USAGE


def test_import_is_light() -> None:
    heavy = ("matplotlib", "plotly", "evo", "pandas", "trimesh", "rosbags", "scipy")
    code = f"import d2lio, sys; print([m for m in {heavy!r} if m in sys.modules])"
    text = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert text.strip() == "[]"


def test_process_that_crashes_or_hangs_is_an_outcome(tmp_path: Path) -> None:
    log = tmp_path / "log"
    crash = run_process([sys.executable, "-c", "import os; os.abort()"], log)
    assert (crash.ok, crash.reason) == (False, "crashed (SIGABRT)")
    hang = run_process([sys.executable, "-c", "import time; time.sleep(60)"], log, 0.2)
    assert not hang.ok
    assert "longer than" in hang.reason
    said = run_process([sys.executable, "-c", "import sys; sys.exit('error: no disk')"], log)
    assert (said.code, said.reason) == (1, "no disk")
    assert run_process([sys.executable, "-c", ""], log).ok
