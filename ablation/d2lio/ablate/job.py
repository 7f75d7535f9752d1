# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the process of one cell does: run, score, note down."""

from __future__ import annotations

import os
import platform
import shutil
from pathlib import Path

import numpy as np

from d2lio import runner
from d2lio.ablate.cell import CELL_FILE, TRUTH_FILE, CellSpec, Costs, Outcome, Scores
from d2lio.datasets import open_source
from d2lio.datasets.recognise import find_truth, recognise
from d2lio.datasets.source import Source
from d2lio.datasets.truth import GroundTruth, at_truth_body, read_truth, write_truth
from d2lio.errors import DataError
from d2lio.metrics import EvaluateOptions, Evaluation, evaluate, read_tum, tum
from d2lio.metrics.time_shift import best_time_shift
from d2lio.record import DIAGNOSTICS_FILE, TRAJECTORY_FILE, RunRecord
from d2lio.report.diagnostics import read_diagnostics

AT_TRUTH_FILE = "trajectory.at_truth.tum"
RUN_DIRECTORY = "run"  # of the finished files, inside the working directory


def carry_out(spec: CellSpec, work: Path) -> Outcome:
    """Runs and scores a cell into `work`/run and writes cell.json there.

    Raises:
        ConfigError: the configuration is refused; DataError: unreadable input.
    """
    place = work / RUN_DIRECTORY
    source = open_source(Path(spec.source), Path(spec.config) if spec.config else None)
    record = _import(spec, place) if spec.imported else _run(spec, source, place)
    outcome = Outcome(digest=spec.digest(), scores=Scores(status="ok"))
    if record is not None:
        _note_run(outcome, record, place)
    if spec.scored:
        _score(outcome, spec, source, record, place)
    (place / CELL_FILE).write_text(outcome.model_dump_json(indent=2) + "\n", encoding="utf-8")
    return outcome


def _run(spec: CellSpec, source: Source, place: Path) -> RunRecord:
    options = runner.RunOptions(
        host=spec.host or "",
        rejection=spec.rejection,
        degeneracy=spec.degeneracy,
        params=spec.params,
        threads=spec.threads,
        start_offset_s=spec.start_offset_s,
        command=["ablate", spec.sequence, f"r{spec.repeat}", spec.variant],
    )
    return runner.run(source, options, place)


def _import(spec: CellSpec, place: Path) -> None:
    place.mkdir(parents=True)
    tum.write(place / TRAJECTORY_FILE, read_tum(Path(spec.imported or "")))


def _note_run(outcome: Outcome, record: RunRecord, place: Path) -> None:
    scores = outcome.scores
    if record.status != "complete":
        scores.fail(f"{record.status}: {record.reason}")
    scores.accepted_share = record.accepted_share
    scores.scans_read, scores.scans_processed = record.scans.read, record.scans.processed
    scores.duration_s = record.duration_s
    columns = read_diagnostics(place / DIAGNOSTICS_FILE)
    scores.lambda_t_min = median(columns.get("lambda_t_1"))
    scores.lambda_r_min = median(columns.get("lambda_r_1"))
    outcome.notes = list(record.notes)
    outcome.costs = _costs(record)


def _costs(record: RunRecord) -> Costs:
    total = record.time_ms.get("total")
    return Costs(
        wall_s=record.wall_s,
        host_s=record.host_s,
        read_s=record.read_s,
        ms_per_scan_mean=total.mean if total else None,
        ms_per_scan_median=total.median if total else None,
        ms_per_scan_p95=total.p95 if total else None,
        stages={name: time.mean for name, time in record.time_ms.items() if name != "total"},
        peak_memory_mb=record.peak_memory_mb,
        cpu=cpu_model(),
        cores=os.cpu_count(),
    )


def median(values: np.ndarray | None) -> float | None:
    """Of the finite numbers of a column; None for a column of texts, or none."""
    if values is None or values.dtype.kind != "f":
        return None
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else None


def _score(
    outcome: Outcome, spec: CellSpec, source: Source, record: RunRecord | None, place: Path
) -> None:
    estimate, truth = place / TRAJECTORY_FILE, place / TRUTH_FILE
    known = _truth(spec, source, truth, outcome)
    start = record.start_stamp_ns if record is not None else None
    if start is not None:
        _cut(truth, start)
    if known is not None and known.trajectory.position_only and not known.in_imu_frame:
        tum.write(place / AT_TRUTH_FILE, at_truth_body(read_tum(estimate), known))
        estimate = place / AT_TRUTH_FILE
    result, curves = evaluate(estimate, truth, EvaluateOptions(out=place))
    outcome.matched = {name: Path(file).name for name, file in result.files.items()}
    note_scores(outcome.scores, result)
    if curves is not None:
        outcome.scores.best_time_shift_s = best_time_shift(estimate, truth)


def note_scores(scores: Scores, result: Evaluation) -> None:
    """Fills in what an evaluation found; a lost run fails."""
    scores.coverage, scores.path_m = result.coverage, result.path_m
    if result.lost:
        scores.fail(result.lost)
    scores.ate_m = result.ate.rmse if result.ate else None
    scores.ate_percent = result.ate_percent
    scores.rpe_10m_m = result.rpe_trans.rmse if result.rpe_trans else None
    scores.rpe_rot_deg = result.rpe_rot.rmse if result.rpe_rot else None
    scores.first_pose_ate_m = result.first_pose_ate
    scores.end_error_m = result.end_error_m
    scores.end_error_percent = result.end_error_percent


def _truth(spec: CellSpec, source: Source, place: Path, outcome: Outcome) -> GroundTruth | None:
    """Puts the ground truth at `place`; what is known of it where it is a data set's."""
    given = Path(spec.truth) if spec.truth else source.ground_truth
    if given is not None:
        _link(given, place)
        return None
    recording = Path(spec.source)
    match = recognise(recording, {})
    file = None if match is None else find_truth(recording, match)
    if match is None or match.truth is None or file is None:
        raise DataError(f"{recording}: no ground truth found around it")
    known = read_truth(file, match.truth, match.device_name)
    outcome.notes += known.notes
    write_truth(place, known)
    return known


def _link(source: Path, place: Path) -> None:
    """A second name for the file: it stays when the sequence is removed, and costs no space."""
    try:
        os.link(source, place)
    except OSError:  # another file system
        shutil.copyfile(source, place)


def _cut(truth: Path, start: int) -> None:
    """Takes the poses before `start`, ns, off the truth."""
    whole = tum.read_tum(truth)
    later = whole.stamps >= start
    if not later.any():
        raise DataError("the ground truth ends before the start")
    truth.unlink()  # never write through to the file it may be a link to
    cut = whole.select(later)
    if cut.position_only:
        write_truth(truth, GroundTruth(cut, False, None, np.zeros(3), []))
    else:
        tum.write(truth, cut)


def cpu_model() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
