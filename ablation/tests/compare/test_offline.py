# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`d2lio compare`: the figures of single runs, failures apart, everything kept."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from comparing import Compared, Quiet
from d2lio.ablate.results import load_rows
from d2lio.cli import app
from d2lio.compare.material import find_material
from d2lio.compare.offline import CompareOptions, compare
from d2lio.compare.shared.names import Variant
from d2lio.compare.tracks import Replay, read_tracks
from d2lio.compare.variants import parse
from d2lio.datasets import open_source
from d2lio.errors import DataError
from d2lio.metrics import evaluate
from d2lio.runner import RunOptions, run
from typer.testing import CliRunner

APE_TOLERANCE_M = 1e-9
HELPERS = Path(__file__).resolve().parent.parent


def test_a_variant_is_what_run_and_evaluate_give(compared: Compared, tmp_path: Path) -> None:
    options = RunOptions(rejection="point_adaptive", degeneracy="noise_aware")
    run(open_source(compared.sequence), options, tmp_path / "run")
    expected, _ = evaluate(tmp_path / "run" / "trajectory.tum", compared.sequence / "gt.tum")
    row = {r.variant: r for r in compared.results.rows}["d2"]
    assert row.status == "ok"
    assert row.ate_m == pytest.approx(expected.ate.rmse, abs=APE_TOLERANCE_M)
    ours = (compared.results.out / row.directory / "trajectory.tum").read_bytes()
    assert ours == (tmp_path / "run" / "trajectory.tum").read_bytes()


def test_the_scoreboard_ends_with_the_figures_of_the_table(compared: Compared) -> None:
    lines = Replay(*read_tracks(compared.results)).end()
    assert [line.title for line in lines] == ["off", "d2"]
    for line, row in zip(lines, compared.results.rows, strict=True):
        assert line.ape == pytest.approx(row.ate_m, abs=APE_TOLERANCE_M)
        assert 1.0 - line.rejected == pytest.approx(row.accepted_share)


def test_the_files_are_those_of_an_ablation(compared: Compared) -> None:
    out = compared.results.out
    assert [row.variant for row in load_rows(out)] == ["off", "d2"]
    for name in ("results.parquet", "timings.csv", "suite.yaml"):
        assert (out / name).is_file()


@pytest.fixture
def crash_host(monkeypatch: pytest.MonkeyPatch):
    """The host `crash` of the ablation's tests, in the processes of runs as well."""
    from d2lio import hosts
    from d2lio.ablate.execute import close_slots

    before = dict(hosts.HOSTS)
    paths = [str(HELPERS / "ablate"), str(HELPERS), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    monkeypatch.setenv("D2LIO_PLUGINS", "plugin_hosts")
    monkeypatch.syspath_prepend(str(HELPERS / "ablate"))
    close_slots()
    yield "crash"
    close_slots()
    sys.modules.pop("plugin_hosts", None)
    hosts.HOSTS.clear()
    hosts.HOSTS.update(before)


def test_a_crash_is_a_failed_row_and_the_others_go_on(
    crash_host: str, room: Path, tmp_path: Path
) -> None:
    good = parse("off")[0]
    bad = Variant("bad", "bad", crash_host, "off", "none", "", good.colour)
    material = find_material(str(room), tmp_path / "out")
    found = compare(material, [bad, good], tmp_path / "out", CompareOptions(), Quiet())
    rows = {row.variant: row for row in found.results.rows}
    assert rows["bad"].status == "fail"
    assert "SIGSEGV" in rows["bad"].reason
    assert rows["off"].status == "ok"
    lines = Replay(*read_tracks(found.results)).end()
    assert [line.state for line in lines] == ["FAIL", "OK"]


def test_ctrl_c_keeps_what_was_done(room: Path, tmp_path: Path) -> None:
    class Impatient(Quiet):
        def finished(self, spec: object, outcome: object) -> None:
            raise KeyboardInterrupt

    out = tmp_path / "out"
    material = find_material(str(room), out)
    with pytest.raises(KeyboardInterrupt):
        compare(material, parse("off,none"), out, CompareOptions(), Impatient())
    assert (out / "runs" / "room_vlp16_s0" / "r0" / "off" / "trajectory.tum").is_file()
    stamp = (out / "runs" / "room_vlp16_s0" / "r0" / "off" / "cell.json").stat().st_mtime_ns
    again = compare(material, parse("off,none"), out, CompareOptions(), Quiet())
    assert [row.status for row in again.results.rows] == ["ok", "ok"]
    after = (out / "runs" / "room_vlp16_s0" / "r0" / "off" / "cell.json").stat().st_mtime_ns
    assert after == stamp


def test_without_truth_there_are_paths_and_diagnostics(room: Path, tmp_path: Path) -> None:
    bag = tmp_path / "own.bag"
    shutil.copyfile(room / "data.bag", bag)
    material = find_material(str(bag), tmp_path / "out")
    assert not material.scored
    found = compare(material, parse("off"), tmp_path / "out", CompareOptions(), Quiet())
    (row,) = found.results.rows
    assert (row.status, row.ate_m) == ("ok", None)
    assert row.scans_processed > 10
    assert any("no ground truth" in note for note in found.results.notes)


def test_truth_and_configuration_may_be_given_beside_a_bag(
    compared: Compared, tmp_path: Path
) -> None:
    import yaml
    from d2lio.datasets.config import SourceConfig
    from d2lio.sequence import Sequence

    room = compared.sequence
    bag, config = tmp_path / "own.bag", tmp_path / "own.yaml"
    shutil.copyfile(room / "data.bag", bag)
    facts = SourceConfig.from_sequence(Sequence.load(room))
    text = facts.model_dump(exclude_none=True, exclude={"ground_truth"})
    config.write_text(yaml.safe_dump(text), encoding="utf-8")
    material = find_material(str(bag), tmp_path / "out", config=config, truth=room / "gt.tum")
    found = compare(material, parse("off"), tmp_path / "out", CompareOptions(), Quiet())
    expected = {row.variant: row for row in compared.results.rows}["off"]
    assert found.results.rows[0].ate_m == expected.ate_m


def test_what_is_neither_file_nor_scene_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="nor a scene"):
        find_material("nowhere", tmp_path)


def test_the_command_simulates_a_scene_and_writes_everything(tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["compare", "room", "--duration", "4", "--variants", "off", "--out", str(out)]
    result = CliRunner().invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert [row["status"] for row in said["rows"]] == ["ok"]
    for key in ("report", "recording"):
        assert Path(said[key]).stat().st_size > 10_000
    assert "Variants on room" in Path(said["report"]).read_text(encoding="utf-8")


def test_the_command_refuses_unknown_variants(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["compare", "room", "--variants", "turbo"])
    assert result.exit_code == 2
