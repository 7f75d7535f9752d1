# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The command: options, outputs, exit codes, what it says on the way."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
import tiny
import yaml
from d2lio.ablate.cell import CellSpec, Outcome
from d2lio.ablate.plan import Group
from d2lio.ablate.progress import Display
from d2lio.ablate.sequences import Origin
from d2lio.ablate.suite import shipped
from d2lio.cli import app
from rich.console import Console
from typer.testing import CliRunner

EXIT_USAGE, EXIT_DATA, EXIT_FAILED = 2, 3, 4


def invoke(*arguments: object):
    return CliRunner().invoke(app, ["ablate", *map(str, arguments)])


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """Two variants on one short sequence, and a column to import."""
    file = tmp_path / "suite.yaml"
    sequences = [{"name": "A Room", "simulate": {"scene": "room", "duration": 3}}]
    variants = [tiny.FASTLIO, tiny.ADAPTIVE, {"id": "mine", "title": "Mine", "import": "mine"}]
    file.write_text(yaml.safe_dump(tiny.data(repeats=1, sequences=sequences, variants=variants)))
    return file


def test_the_shipped_suites_are_listed() -> None:
    result = invoke("--list")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == sorted(shipped())
    listed = json.loads(invoke("--list", "--json").stdout)
    assert set(listed) == set(shipped())
    assert listed["table2"]["repeats"] >= 5


def test_a_whole_ablation_with_report(suite: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = invoke(suite, "--out", out, "--jobs", "2")
    assert result.exit_code == 0, result.stderr
    assert "A Room" in result.stdout
    assert "results.csv" in result.stdout
    assert "[2/2] A Room r0" in result.stderr
    assert "mine left out: no --import mine=DIR" in " ".join(result.stderr.split())
    assert (out / "report.html").stat().st_size > 1000
    assert yaml.safe_load((out / "suite.yaml").read_text())["name"] == "tiny"


def test_json_and_an_imported_column(suite: Path, tmp_path: Path) -> None:
    first = tmp_path / "first"
    invoke(suite, "--out", first, "--only-variants", "fastlio")
    given = tmp_path / "given"
    given.mkdir()
    (given / "A Room.tum").write_bytes(
        (first / "runs/A_Room/r0/fastlio/trajectory.tum").read_bytes()
    )
    result = invoke(suite, "--out", tmp_path / "out", "--import", f"mine={given}", "--json")
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    rows = {row["variant"]: row for row in data["rows"]}
    assert list(rows) == ["fastlio", "adaptive", "mine"]
    assert rows["mine"]["ate_m"] == pytest.approx(rows["fastlio"]["ate_m"], abs=1e-9)
    assert rows["mine"]["host"] == ""
    assert data["problems"] == {}
    assert Path(data["report"]).is_file()
    # Another trajectory under the same name is another result.
    text = (given / "A Room.tum").read_text().splitlines(keepends=True)
    (given / "A Room.tum").write_text("".join(text[: len(text) // 2]))
    again = invoke(suite, "--out", tmp_path / "out", "--import", f"mine={given}", "--json")
    row = next(r for r in json.loads(again.stdout)["rows"] if r["variant"] == "mine")
    assert row["status"] == "fail"
    assert "coverage" in row["reason"]
    assert "2 of 3 cells are done already" in again.stderr


def test_only_some_of_it(suite: Path, tmp_path: Path) -> None:
    result = invoke(
        suite, "--out", tmp_path / "o", "--only-variants", "adaptive", "--repeats", "2",
        "--only-sequences", "A Room", "--keep-sequences", "--json",
    )  # fmt: skip
    rows = json.loads(result.stdout)["rows"]
    assert [(row["variant"], row["repeat"], row["seed"]) for row in rows] == [
        ("adaptive", 0, 0),
        ("adaptive", 1, 1),
    ]
    assert len(list((tmp_path / "o" / "sequences").iterdir())) == 2


def test_failed_runs_are_results(suite: Path, tmp_path: Path) -> None:
    data = yaml.safe_load(suite.read_text())
    data["variants"] = [tiny.FASTLIO, {**tiny.ADAPTIVE, "params": {"rejection.tau": -1}}]
    suite.write_text(yaml.safe_dump(data))
    result = invoke(suite, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "FAIL: " in result.stderr


def test_what_cannot_be_carried_out_is_exit_code_4(suite: Path, tmp_path: Path) -> None:
    data = yaml.safe_load(suite.read_text())
    data["sequences"].append({"name": "B", "simulate": {"scene": "room", "duration": 1e5}})
    suite.write_text(yaml.safe_dump(data))
    result = invoke(suite, "--out", tmp_path / "out")
    assert result.exit_code == EXIT_FAILED
    assert "not carried out: simulating B_s0" in result.stderr
    assert "2 cells were not carried out" in result.stderr
    assert (tmp_path / "out" / "results.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ([], EXIT_USAGE, "give the name of a suite"),
        (["tabel2"], EXIT_USAGE, "table2"),
        (["SUITE", "--only-variants", "x"], EXIT_USAGE, "--only-variants = 'x'"),
        (["SUITE", "--import", "mine"], EXIT_USAGE, "NAME=DIR"),
        (["SUITE", "--import", "yours=."], EXIT_USAGE, "--import = 'yours'"),
        (["SUITE", "--import", "mine=/nowhere"], EXIT_DATA, "/nowhere: no such directory"),
        (["SUITE", "--data", "/nowhere"], EXIT_DATA, "/nowhere"),
        (["SUITE", "--jobs", "0"], EXIT_USAGE, "--jobs"),
    ],
)
def test_bad_usage(suite: Path, tmp_path: Path, arguments: list[str], code: int, said: str) -> None:
    given = [str(suite) if text == "SUITE" else text for text in arguments]
    result = invoke(*given, "--out", tmp_path / "out")
    assert result.exit_code == code
    assert said in result.stderr


def cell(variant: str) -> CellSpec:
    return CellSpec(
        sequence="Room", repeat=0, variant=variant, directory=f"runs/Room/r0/{variant}",
        source="room", origin={}, host="fastlio", version="0",
    )  # fmt: skip


def outcome(status: str, seconds: float) -> Outcome:
    return Outcome.model_validate(
        {
            "digest": "x",
            "scores": {"status": status, "reason": "bad [luck]", "ate_m": 0.5},
            "costs": {"process_s": seconds},
        }
    )


def shown(*, terminal: bool) -> str:
    """What the display says about three cells: one done before, one fine, one failed."""
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=terminal, width=100, color_system=None)
    cells = [cell(name) for name in "abc"]
    with Display(console) as display:
        group = Group(Origin(Path("room"), {}, {"scene": "room"}), cells)
        display.begin([group], {cells[0].directory: outcome("ok", 7.0)}, 1)
        display.started(cells[1].label)
        display.finished(cells[1], outcome("ok", 20.0))
        display.started(cells[2].label)
        display.tick(0)
        display.finished(cells[2], outcome("fail", 20.0))
    return stream.getvalue()


def test_lines_where_there_is_no_terminal() -> None:
    assert shown(terminal=False).splitlines() == [
        "1 of 3 cells are done already",
        "[2/3] Room r0 b: ATE 0.500 m; 14 s left",
        "[3/3] Room r0 c: FAIL: bad [luck]; waiting for workers",
    ]


def test_a_live_display_on_a_terminal() -> None:
    text = shown(terminal=True)
    assert "2/3 cells, 14 s left" in text
    assert "2/3 cells, waiting for workers" in text
    assert "Room r0 c 0 s" in text
    assert "3/3 cells, 1 failed" in text
