# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Results and report out of what nodes saved."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from comparing import Compared
from d2lio.ablate.results import load
from d2lio.cli import app
from d2lio.compare.collect import collect
from d2lio.compare.shared import names
from d2lio.errors import DataError
from typer.testing import CliRunner


@pytest.fixture
def saved(compared: Compared, tmp_path: Path) -> Path:
    """An output directory as the launcher and three nodes leave it, one of them killed early."""
    variants = names.parse("off,d2,kiss")
    for row in compared.results.rows:
        place = tmp_path / "nodes" / row.variant
        place.mkdir(parents=True)
        for name in ("trajectory.tum", "diagnostics.csv"):
            shutil.copyfile(compared.results.out / row.directory / name, place / name)
    meta = {
        "sequence": "room",
        "bag": str(compared.sequence / "data.bag"),
        "config": str(compared.sequence / "sequence.yaml"),
        "truth": str(compared.sequence / "gt.tum"),
        "variants": [dict(variant._asdict()) for variant in variants],
    }
    (tmp_path / "compare.json").write_text(json.dumps(meta), encoding="utf-8")
    states = {"off": "OK", "d2": "OK", "kiss": "DEAD"}
    state = {"variants": {name: {"state": state} for name, state in states.items()}}
    (tmp_path / "scoreboard.json").write_text(json.dumps(state), encoding="utf-8")
    return tmp_path


def test_figures_are_those_of_the_offline_run(saved: Path, compared: Compared) -> None:
    found = {row.variant: row for row in collect(saved).rows}
    for row in compared.results.rows:
        again = found[row.variant]
        assert (again.status, again.ate_m) == ("ok", row.ate_m)
        assert again.accepted_share == pytest.approx(row.accepted_share)
        assert again.lambda_t_min == pytest.approx(row.lambda_t_min)
        assert again.best_time_shift_s == row.best_time_shift_s
    assert (found["kiss"].status, found["kiss"].reason) == ("fail", "the node died")
    assert [row.variant for row in load(saved).rows] == ["off", "d2", "kiss"]


def test_the_command_writes_report_and_recording(saved: Path) -> None:
    result = CliRunner().invoke(app, ["compare-collect", str(saved)])
    assert result.exit_code == 0, result.output
    for name in ("results.csv", "results.parquet", "suite.yaml", "report.html", "compare.rrd"):
        assert (saved / name).stat().st_size > 0
    assert "the node died" in result.output


def test_without_any_trajectory_it_fails(saved: Path) -> None:
    shutil.rmtree(saved / "nodes")
    result = CliRunner().invoke(app, ["compare-collect", str(saved)])
    assert result.exit_code == 4
    assert "no variant gave a trajectory" in result.output


def test_a_directory_of_something_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"compare\.json"):
        collect(tmp_path)
