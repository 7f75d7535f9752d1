# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The tidy tables of an ablation: one row per cell, results apart from timings.

results.csv holds only what a rerun reproduces exactly, so that two of them can be compared byte by
byte; timings.csv holds what differs from one machine or run to the next. Both exist as Parquet too.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from d2lio.errors import DataError
from d2lio.output import replace_file

if TYPE_CHECKING:
    from d2lio.ablate.suite import Suite

RESULTS_FILE = "results.csv"
TIMINGS_FILE = "timings.csv"
SUITE_FILE = "suite.yaml"

Status = Literal["ok", "fail"]
Key = tuple[str, int, str]  # sequence, repeat, variant
Cell = str | int | float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One cell: a variant on one repeat of a sequence. Figures are None where there are none.

    Attributes:
        scene, sensor: of a simulated sequence, else empty.
        seed: of the simulation; start_offset_s: of a recording.
        params: JSON text of the parameters that the suite sets.
        status: `fail` for a crash, a time-out, too much memory, divergence, a coverage below 95 %
            or an ATE beyond 5 % of the path, with its reason; `ate_m` is kept where it exists.
        coverage: share of the truth's time span, [0, 1].
        lambda_t_min, lambda_r_min: median over the scans of the smallest eigenvalue of the
            translation block, points, and of the rotation block, points·m².
        path_m: of the truth.
        directory: of the run's files, relative to the output directory.
    """

    suite: str
    sequence: str
    dataset: str = ""
    scene: str = ""
    sensor: str = ""
    repeat: int
    seed: int | None = None
    start_offset_s: float | None = None
    variant: str
    variant_title: str = ""
    group: str = ""
    host: str = ""
    rejection: str = ""
    degeneracy: str = ""
    params: str = "{}"
    status: Status
    reason: str = ""
    coverage: float | None = None
    ate_m: float | None = None
    ate_percent: float | None = None
    rpe_10m_m: float | None = None
    rpe_rot_deg: float | None = None
    first_pose_ate_m: float | None = None
    end_error_m: float | None = None
    end_error_percent: float | None = None
    best_time_shift_s: float | None = None
    accepted_share: float | None = None
    lambda_t_min: float | None = None
    lambda_r_min: float | None = None
    scans_read: int | None = None
    scans_processed: int | None = None
    path_m: float | None = None
    duration_s: float | None = None
    directory: str = ""
    version: str = ""

    @property
    def key(self) -> Key:
        """What names the cell: sequence, repeat, variant."""
        return self.sequence, self.repeat, self.variant


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingRow:
    """What a cell cost on the machine it ran on.

    Attributes:
        wall_s: whole run; host_s: inside the estimator; read_s: reading and decoding.
        ms_per_scan_mean, _median, _p95: of the scans that gave a pose.
        stages: mean ms per scan by stage, columns `stage_<name>_ms`.
    """

    sequence: str
    repeat: int
    variant: str
    wall_s: float | None = None
    host_s: float | None = None
    read_s: float | None = None
    ms_per_scan_mean: float | None = None
    ms_per_scan_median: float | None = None
    ms_per_scan_p95: float | None = None
    stages: Mapping[str, float | None] = field(default_factory=dict)
    peak_memory_mb: float | None = None
    cpu: str = ""
    cores: int | None = None

    @property
    def key(self) -> Key:
        """What names the cell: sequence, repeat, variant."""
        return self.sequence, self.repeat, self.variant


@dataclass(slots=True)
class Results:
    """All that tables and report are made of.

    Attributes:
        out: directory of the ablation; `directory` of a row is relative to it.
        rows: in the order of the suite.
        timings: by (sequence, repeat, variant); a run that crashed may have none.
        notes: what was left out, and why.
    """

    suite: Suite
    rows: list[ResultRow]
    timings: dict[Key, TimingRow]
    out: Path
    notes: list[str] = field(default_factory=list)


def save(out: Path, rows: Iterable[ResultRow], timings: Iterable[TimingRow]) -> None:
    """Writes both tables as CSV and Parquet, each file in one go.

    Raises:
        DataError: cannot be written.
    """
    _write(out / RESULTS_FILE, _result_types(), [_flat(row) for row in rows])
    costs = [_flat(row) for row in timings]
    _write(out / TIMINGS_FILE, _timing_types(costs), costs)


def discard(out: Path) -> None:
    """Removes both tables."""
    for name in (RESULTS_FILE, TIMINGS_FILE):
        for file in (out / name, (out / name).with_suffix(".parquet")):
            file.unlink(missing_ok=True)


def write_text(file: Path, text: str) -> None:
    """Writes a file in one go.

    Raises:
        DataError: cannot be written.
    """
    try:
        replace_file(file, text)
    except OSError as err:
        raise DataError(f"{file}: cannot be written: {err.strerror}") from None


def load(out: Path) -> Results:
    """Reads suite.yaml, results.csv and timings.csv of an ablation.

    Raises:
        DataError: a file that is missing or not such a table; ConfigError: a bad suite.
    """
    from d2lio.ablate.suite import Suite

    return Results(Suite.load(out / SUITE_FILE), load_rows(out), load_timings(out), out)


def load_rows(out: Path) -> list[ResultRow]:
    """The rows of results.csv."""
    file = out / RESULTS_FILE
    return [ResultRow(**record) for record in _read(file, _result_types())]


def load_timings(out: Path) -> dict[Key, TimingRow]:
    """The rows of timings.csv by their cell; none where the file is absent."""
    file = out / TIMINGS_FILE
    if not file.exists():
        return {}
    rows = []
    for record in _read(file, _timing_types([])):
        extra = [name for name in record if name.startswith("stage_")]
        stages = {name[len("stage_") : -len("_ms")]: record.pop(name) for name in extra}
        rows.append(TimingRow(**record, stages=stages))
    return {row.key: row for row in rows}


def _kinds(model: type) -> dict[str, type]:
    """Column → str, int or float, from the annotations."""
    found: dict[str, type] = {}
    for entry in fields(model):
        text = str(entry.type)
        found[entry.name] = next((k for k in (float, int) if k.__name__ in text.split()), str)
    return found


def _result_types() -> dict[str, type]:
    return _kinds(ResultRow)


def _timing_types(records: Sequence[Mapping[str, Cell]]) -> dict[str, type]:
    kinds = _kinds(TimingRow)
    stages = {k: float for record in records for k in record if k.startswith("stage_")}
    types: dict[str, type] = {}
    for name, kind in kinds.items():
        types |= stages if name == "stages" else {name: kind}
    return types


def _flat(row: ResultRow | TimingRow) -> dict[str, Cell]:
    record: dict[str, Any] = {entry.name: getattr(row, entry.name) for entry in fields(row)}
    stages = record.pop("stages", {})
    return record | {f"stage_{name}_ms": value for name, value in stages.items()}


def _write(file: Path, types: Mapping[str, type], records: Sequence[Mapping[str, Cell]]) -> None:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(types), lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: _text(record.get(k)) for k in types} for record in records)
    try:
        replace_file(file, text.getvalue())
        replace_file(file.with_suffix(".parquet"), _parquet(types, records))
    except OSError as err:
        raise DataError(f"{file}: cannot be written: {err.strerror}") from None


def _text(value: Cell) -> str:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def _parquet(types: Mapping[str, type], records: Sequence[Mapping[str, Cell]]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    arrow = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, arrow[kind]) for name, kind in types.items()])
    columns = {name: [record.get(name) for record in records] for name in types}
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns, schema=schema), stream)
    return stream.getvalue()


def _read(file: Path, types: Mapping[str, type]) -> list[dict[str, Any]]:
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            records = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise DataError(f"{file}: cannot be read: {err}") from None
    try:
        return [{name: _value(name, text, types) for name, text in r.items()} for r in records]
    except (KeyError, TypeError, ValueError) as err:
        raise DataError(f"{file}: not a table of ours: {err}") from None


def _value(name: str, text: str, types: Mapping[str, type]) -> Cell:
    kind = float if name.startswith("stage_") else types[name]
    return text if kind is str else (kind(text) if text else None)
