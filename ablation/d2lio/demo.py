# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The ablation in small: three simulated scenes, three hosts, fifteen variants, one table."""

from __future__ import annotations

import csv
import io
import math
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from d2lio.errors import DataError
from d2lio.hosts import NEED_GTSAM, REJECTION_MODES, SHORT_TITLES, liosam_missing
from d2lio.jobs import d2lio_command, run_process
from d2lio.metrics import Curves, Evaluation, evaluate
from d2lio.output import replace_file
from d2lio.record import TRAJECTORY_FILE, RunRecord
from d2lio.sequence import FILE_NAME, Sequence

RUN_TIMEOUT_S = 900.0
SENSOR = "vlp16"
RESULTS_FILE = "results.csv"
REPORT_FILE = "report.html"

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Scene:
    """A simulated sequence of the demo.

    Attributes:
        duration: s, None for the scene's own.
        params: host parameters that every variant gets there, as `key=value`.
    """

    name: str
    title: str
    duration: float | None
    params: tuple[str, ...] = ()
    seed: int = 0

    @property
    def directory(self) -> str:
        """Name of its directory in the cache; what is in it follows from the name."""
        length = "" if self.duration is None else f"_{self.duration:g}s"
        return f"{self.name}_{SENSOR}_s{self.seed}{length}"


@dataclass(frozen=True, slots=True)
class Variant:
    """A row of the table."""

    rejection: str
    degeneracy: str
    host: str = "fastlio"

    @property
    def group(self) -> str:
        """Title over the rows that differ in the rejection mode only."""
        return SHORT_TITLES.get(self.host, self.host) + self._method

    @property
    def label(self) -> str:
        """Name of the row where its group is not in sight."""
        return f"{SHORT_TITLES.get(self.host, self.host)} {self.rejection}{self._method}"

    @property
    def _method(self) -> str:
        return {"none": "", "paper": " + prior"}.get(self.degeneracy, f" + {self.degeneracy}")

    @property
    def directory(self) -> str:
        """Name of its directory below the scene's."""
        return f"{self.host}_{self.rejection}_{self.degeneracy}"


SCENES = (
    Scene("offroad", "Off-road", 20.0),
    Scene("tunnel_cabinets", "Tunnel with cabinets", None),
    Scene("room", "Room", None),
)
# The whole ablation on the FAST-LIO2 host; of the others what shows the step from LIO-SAM as it is
# to D2-LIO as it is, whose defaults are point_adaptive and noise_aware.
VARIANTS = (
    *(
        Variant(rejection, degeneracy)
        for degeneracy in ("none", "paper")
        for rejection in REJECTION_MODES
    ),
    Variant("off", "noise_aware"),
    Variant("off", "none", "liosam"),
    Variant("point_adaptive", "none", "liosam"),
    Variant("point_adaptive", "paper", "liosam"),
    Variant("off", "none", "d2lio"),
    Variant("point_adaptive", "paper", "d2lio"),
    Variant("point_adaptive", "noise_aware", "d2lio"),
)


def runnable(variants: tuple[Variant, ...]) -> tuple[tuple[Variant, ...], str]:
    """The variants whose host is built, and what to tell about the others (may be empty)."""
    why = liosam_missing()
    if why is None or not any(v.host in NEED_GTSAM for v in variants):
        return variants, ""
    return tuple(v for v in variants if v.host not in NEED_GTSAM), why


@dataclass(slots=True)
class Row:
    """One run: where it lies and what came out; the last three are None if it crashed."""

    scene: Scene
    variant: Variant
    directory: Path
    status: str = "ok"  # ok, fail
    reason: str = ""
    record: RunRecord | None = None
    evaluation: Evaluation | None = None
    curves: Curves | None = None

    @property
    def ate(self) -> float | None:
        """ATE RMSE, m."""
        scored = self.evaluation
        return scored.ate.rmse if scored is not None and scored.ate is not None else None

    @property
    def ms_per_scan(self) -> float | None:
        """Median time per scan, ms (the mean is that of the machine's other work as well)."""
        total = self.record.time_ms.get("total") if self.record else None
        return total.median if total else None

    def fail(self, reason: str) -> None:
        """Marks the run as failed; the first reason stays."""
        self.status, self.reason = "fail", self.reason or reason


@dataclass(slots=True)
class DemoResult:
    """Everything the report needs."""

    out: Path
    rows: list[Row]
    scenes: tuple[Scene, ...]
    variants: tuple[Variant, ...]
    note: str = ""  # what was left out, and why
    ground_truths: dict[str, Path] = field(default_factory=dict)

    @property
    def crashed(self) -> list[Row]:
        """Runs without a record (crash, refused configuration, time out)."""
        return [row for row in self.rows if row.record is None]

    def row(self, scene: Scene, variant: Variant) -> Row | None:
        """The run of a cell."""
        found = (r for r in self.rows if r.scene == scene and r.variant == variant)
        return next(found, None)


def ensure_sequence(scene: Scene, cache: Path, progress: Progress) -> Path:
    """The scene's sequence directory, simulated if it is not there yet."""
    from d2lio.simulator import simulate

    path = cache / scene.directory
    if not (path / FILE_NAME).is_file():
        cache.mkdir(parents=True, exist_ok=True)
        simulate(
            scene.name,
            path,
            sensor=SENSOR,
            seed=scene.seed,
            duration=scene.duration,
            progress=lambda done, total: progress(f"simulating {scene.title}", done, total),
        )
    return path


def run_demo(
    out: Path,
    *,
    threads: int = 1,
    scenes: tuple[Scene, ...] = SCENES,
    variants: tuple[Variant, ...] = VARIANTS,
    progress: Progress | None = None,
) -> DemoResult:
    """Simulates, runs and scores; writes results.csv and report.html into `out`.

    Every run has its own process: a crash or divergence is a row with status fail and its
    reason, the others go on.

    Raises:
        DataError: a sequence cannot be simulated or results cannot be written.
    """
    from d2lio.report.page import write_report

    tell = progress or (lambda what, done, total: None)
    out.mkdir(parents=True, exist_ok=True)
    variants, note = runnable(variants)
    result = DemoResult(out, [], scenes, variants, note)
    sequences = {scene: ensure_sequence(scene, out / "sequences", tell) for scene in scenes}
    total = len(scenes) * len(variants)
    for scene, variant in ((s, v) for s in scenes for v in variants):
        tell(f"{scene.title}: {variant.label}", len(result.rows), total)
        truth = Sequence.load(sequences[scene]).ground_truth_path
        if truth is None:
            raise DataError(f"{sequences[scene]}: has no ground truth")
        result.ground_truths[scene.name] = truth
        place = out / "runs" / scene.directory / variant.directory
        row = Row(scene, variant, place)
        _run_row(row, sequences[scene], truth, threads)
        result.rows.append(row)
        write_csv(out / RESULTS_FILE, result.rows)
    tell("report", total, total)
    write_report(result, out / REPORT_FILE)
    return result


def _run_row(row: Row, sequence: Path, truth: Path, threads: int) -> None:
    row.directory.parent.mkdir(parents=True, exist_ok=True)
    log = row.directory.with_suffix(".log")
    assignments = [part for text in row.scene.params for part in ("--set", text)]
    command = d2lio_command(
        "run",
        str(sequence),
        "--host",
        row.variant.host,
        "--rejection",
        row.variant.rejection,
        "--degeneracy",
        row.variant.degeneracy,
        "--threads",
        str(threads),
        "--out",
        str(row.directory),
        *assignments,
    )
    shutil.rmtree(row.directory, ignore_errors=True)  # never score an earlier run
    outcome = run_process(command, log, RUN_TIMEOUT_S)
    if not outcome.ok:
        row.fail(outcome.reason)
    if (row.directory / TRAJECTORY_FILE).exists():
        _score(row, truth)
    else:
        row.fail("wrote no trajectory")


def _score(row: Row, truth: Path) -> None:
    row.record = RunRecord.load(row.directory)
    row.evaluation, row.curves = evaluate(row.directory / TRAJECTORY_FILE, truth)
    if row.evaluation.lost:
        row.fail(row.evaluation.lost)


CSV_COLUMNS = (
    "scene", "host", "rejection", "degeneracy", "status", "reason", "coverage", "ate_m",
    "ate_percent", "rpe_10m_m", "first_pose_ate_m", "end_error_m", "accepted_share",
    "ms_per_scan_median", "ms_per_scan_p95", "peak_memory_mb", "scans", "path_m", "directory",
)  # fmt: skip


def csv_row(row: Row, base: Path) -> dict[str, object]:
    """One tidy line; empty cells where a figure does not exist."""
    scored, record = row.evaluation, row.record
    total = record.time_ms.get("total") if record else None
    values: dict[str, object] = {
        "scene": row.scene.name,
        "host": row.variant.host,
        "rejection": row.variant.rejection,
        "degeneracy": row.variant.degeneracy,
        "status": row.status,
        "reason": row.reason,
        "ate_m": row.ate,
        "ms_per_scan_median": row.ms_per_scan,
        "ms_per_scan_p95": total.p95 if total else None,
        "directory": os.path.relpath(row.directory, base),
    }
    if scored:
        values |= {
            "coverage": scored.coverage,
            "ate_percent": scored.ate_percent,
            "rpe_10m_m": scored.rpe_trans.rmse if scored.rpe_trans else None,
            "first_pose_ate_m": scored.first_pose_ate,
            "end_error_m": scored.end_error_m,
            "path_m": scored.path_m,
        }
    if record:
        values |= {
            "accepted_share": record.accepted_share,
            "peak_memory_mb": record.peak_memory_mb,
            "scans": record.scans.processed,
        }
    return {column: values.get(column) for column in CSV_COLUMNS}


def write_csv(path: Path, rows: list[Row]) -> None:
    """Writes results.csv in one go, so that it is whole at any moment."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, CSV_COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(csv_row(row, path.parent) for row in rows)
    replace_file(path, text.getvalue())


def cells(result: DemoResult, variant: Variant) -> Iterator[tuple[str, str, str]]:
    """Texts (ATE, accepted share, ms per scan) of a table row, scene by scene."""
    for scene in result.scenes:
        row = result.row(scene, variant)
        yield ("-", "-", "-") if row is None else cell(row)


def cell(row: Row) -> tuple[str, str, str]:
    """ATE in metres, `-` with the figure in brackets for a run that failed; share; ms."""
    share = row.record.accepted_share if row.record else None
    ms = row.ms_per_scan
    return (
        _ate_text(row),
        "-" if share is None else f"{100 * share:.0f}%",
        "-" if ms is None or not math.isfinite(ms) else f"{ms:.1f}",
    )


def _ate_text(row: Row) -> str:
    if row.ate is not None:
        return f"{row.ate:.3f}" if row.status == "ok" else f"- ({row.ate:.1f})"
    if row.evaluation is not None:
        return f"- (cov. {100 * row.evaluation.coverage:.0f}%)"
    return "FAIL"
