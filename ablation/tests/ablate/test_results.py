# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The result tables: columns, CSV against Parquet, and evo's command line against both."""

from __future__ import annotations

import csv
import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tiny
from d2lio.ablate import results
from d2lio.ablate.ablation import AblateOptions, ablate
from d2lio.ablate.cell import read_outcome
from d2lio.ablate.results import ResultRow, TimingRow
from d2lio.errors import DataError
from pyarrow import parquet

EVO_PARITY = 1e-6  # evo's command line prints six decimals
PROMISED = (
    "suite,sequence,dataset,scene,sensor,repeat,seed,start_offset_s,variant,variant_title,group,"
    "host,rejection,degeneracy,params,status,reason,coverage,ate_m,ate_percent,rpe_10m_m,"
    "rpe_rot_deg,first_pose_ate_m,end_error_m,end_error_percent,best_time_shift_s,accepted_share,"
    "lambda_t_min,lambda_r_min,scans_read,scans_processed,path_m,duration_s,directory,version"
)
TIMING_COLUMNS = (
    "sequence,repeat,variant,wall_s,host_s,read_s,ms_per_scan_mean,ms_per_scan_median,"
    "ms_per_scan_p95,peak_memory_mb,cpu,cores"
)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("results") / "out"
    suite = tiny.suite(
        repeats=1,
        sequences=[{"name": "First Room", "dataset": "made", "simulate": tiny.ROOM}],
        variants=[
            tiny.FASTLIO,
            {**tiny.ADAPTIVE, "title": "With, a comma", "params": {"rejection.epsilon_0": 0.6}},
            {"id": "refused", "host": "fastlio", "params": {"rejection.tau": -1}},
        ],
    )
    ablate(suite, path, AblateOptions(), tiny.Memory())
    return path


def test_columns_are_the_promised_ones(out: Path) -> None:
    with (out / "results.csv").open() as stream:
        assert stream.readline().rstrip("\n") == PROMISED
    with (out / "timings.csv").open() as stream:
        names = next(csv.reader(stream))
    assert ",".join(n for n in names if not n.startswith("stage_")) == TIMING_COLUMNS
    assert any(re.fullmatch(r"stage_\w+_ms", name) for name in names)


def test_parquet_holds_what_csv_holds(out: Path) -> None:
    for name in ("results", "timings"):
        table = parquet.read_table(out / f"{name}.parquet").to_pylist()
        with (out / f"{name}.csv").open(newline="") as stream:
            texts = list(csv.DictReader(stream))
        assert len(table) == len(texts) > 0
        for record, text in zip(table, texts, strict=True):
            assert list(record) == list(text)
            assert {k: "" if v is None else str(v) for k, v in record.items()} == text


def test_what_is_loaded_is_what_was_found(out: Path) -> None:
    loaded = results.load(out)
    rows = {row.variant: row for row in loaded.rows}
    assert list(rows) == ["fastlio", "adaptive", "refused"]
    row = rows["adaptive"]
    outcome = read_outcome(out / row.directory)
    assert outcome is not None
    for name, value in outcome.scores.model_dump().items():
        assert getattr(row, name) == value
    assert (row.variant_title, row.params) == ("With, a comma", '{"rejection.epsilon_0": "0.6"}')
    assert (row.scene, row.sensor, row.seed, row.start_offset_s) == ("room", "vlp16", 0, None)
    assert rows["refused"].status == "fail"
    assert rows["refused"].ate_m is None
    assert "rejection.tau" in rows["refused"].reason
    assert loaded.suite.name == "tiny"
    assert loaded.timings[row.key].cores is not None
    assert loaded.timings[row.key].stages


def test_evos_command_line_gives_the_same_ate(out: Path) -> None:
    row = results.load(out).rows[0]
    outcome = read_outcome(out / row.directory)
    assert outcome is not None
    place = out / row.directory
    files = [str(place / outcome.matched[name]) for name in ("truth", "estimate")]
    assert row.ate_m == pytest.approx(evo_ape(*files), abs=EVO_PARITY)


def evo_ape(truth: str, estimate: str) -> float:
    """RMSE as printed by evo's own command line."""
    program = Path(sys.executable).with_name("evo_ape")
    command = [str(program)]
    if not program.exists():
        command = [sys.executable, "-c", "from evo.cli.ape import main; main()"]
    text = subprocess.run(
        [*command, "tum", truth, estimate, "-a"], capture_output=True, text=True, check=True
    ).stdout
    found = re.search(r"rmse\s+(\S+)", text)
    assert found is not None, text
    return float(found.group(1))


def test_saved_and_loaded_rows_are_equal(tmp_path: Path) -> None:
    rows = [
        ResultRow(suite="s", sequence="a", repeat=0, variant="v", status="ok", ate_m=1 / 3),
        ResultRow(suite="s", sequence="a", repeat=1, variant="v", status="fail", reason='"x",\ny'),
    ]
    timings = [
        TimingRow(sequence="a", repeat=0, variant="v", wall_s=0.1, stages={"search": 2.0}),
        TimingRow(sequence="a", repeat=1, variant="v", stages={"map": None}),
    ]
    results.save(tmp_path, rows, timings)
    assert results.load_rows(tmp_path) == rows
    loaded = results.load_timings(tmp_path)
    assert loaded["a", 0, "v"].stages == {"search": 2.0, "map": None}
    assert dataclasses.replace(loaded["a", 1, "v"], stages={}) == dataclasses.replace(
        timings[1], stages={}
    )


def test_a_table_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "results.csv").write_text("suite,weather\nx,fine\n")
    with pytest.raises(DataError, match="not a table of ours"):
        results.load_rows(tmp_path)
    with pytest.raises(DataError, match="cannot be read"):
        results.load_rows(tmp_path / "nowhere")
