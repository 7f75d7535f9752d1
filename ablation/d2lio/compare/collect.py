# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Makes results and report out of what the ROS nodes of a comparison saved.

Reads OUT/compare.json (what was run), OUT/nodes/ID/ (trajectory and diagnostics of each variant)
and OUT/scoreboard.json (who died); writes the files of `d2lio ablate`.
"""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from d2lio import __version__
from d2lio.ablate import results
from d2lio.ablate.cell import (
    CELL_FILE,
    TRUTH_FILE,
    CellSpec,
    Costs,
    Outcome,
    Scores,
    result_row,
    run_directory,
    spec_of,
    timing_row,
)
from d2lio.ablate.job import cpu_model, median, note_scores
from d2lio.ablate.results import Results
from d2lio.ablate.suite import Suite, SuiteSequence
from d2lio.compare.shared.names import Variant
from d2lio.compare.variants import suite_of
from d2lio.errors import ConfigError, DataError
from d2lio.metrics import EvaluateOptions, evaluate, read_tum
from d2lio.metrics.time_shift import best_time_shift
from d2lio.metrics.tum import finite
from d2lio.record import DIAGNOSTICS_FILE, TRAJECTORY_FILE
from d2lio.report.diagnostics import processed, read_diagnostics

META_FILE, STATE_FILE, NODES = "compare.json", "scoreboard.json", "nodes"
DEAD = "DEAD"
TIME_COLUMN = "time_total_ms"
MIN_POSES = 2


class NamedVariant(BaseModel):
    """See `shared.names.Variant`."""

    model_config = ConfigDict(extra="forbid")

    id: str
    title: str
    host: str
    rejection: str
    degeneracy: str
    upstream: str
    colour: str


class Meta(BaseModel):
    """compare.json; paths are empty where there is none."""

    model_config = ConfigDict(extra="forbid")

    sequence: str
    bag: str = ""
    config: str = ""
    truth: str = ""
    variants: list[NamedVariant]


def read_meta(out: Path) -> Meta:
    """What was run.

    Raises:
        DataError: missing or not of ours.
    """
    file = out / META_FILE
    try:
        return Meta.model_validate_json(file.read_text(encoding="utf-8"))
    except OSError as err:
        raise DataError(f"{file}: cannot be read: {err.strerror}") from None
    except ValidationError as err:
        raise DataError(f"{file}: not a comparison: {err.errors()[0]['msg']}") from None


def collect(out: Path) -> Results:
    """Scores every variant and writes suite.yaml, results and timings.

    Raises:
        DataError: unreadable or unwritable.
    """
    meta = read_meta(out)
    variants = [Variant(**variant.model_dump()) for variant in meta.variants]
    suite = suite_of(variants, SuiteSequence(name=meta.sequence, recording=[meta.sequence]))
    truth = Path(meta.truth) if meta.truth and Path(meta.truth).is_file() else None
    dead = _dead(out)
    rows, timings = [], []
    shutil.rmtree((out / run_directory(meta.sequence, 0, "any")).parent, ignore_errors=True)
    for variant in variants:
        spec = _spec(suite, variant, meta)
        outcome = _outcome(out, spec, truth, variant.id in dead)
        rows.append(result_row(suite, spec, outcome.scores))
        timings.append(timing_row(spec, outcome.costs))
    results.write_text(out / results.SUITE_FILE, suite.to_yaml())
    results.save(out, rows, timings)
    notes = [] if truth is not None else ["no ground truth: paths and diagnostics only"]
    return Results(suite, rows, {row.key: row for row in timings}, out, notes)


def _dead(out: Path) -> set[str]:
    """Variants whose process was gone before the end."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        state = json.loads((out / STATE_FILE).read_text(encoding="utf-8"))
        return {name for name, line in state["variants"].items() if line["state"] == DEAD}
    return set()


def _spec(suite: Suite, variant: Variant, meta: Meta) -> CellSpec:
    return spec_of(
        suite.variant(variant.id),
        sequence=meta.sequence,
        repeat=0,
        directory=run_directory(meta.sequence, 0, variant.id),
        source=meta.bag,
        origin={"kind": "ros", "bag": Path(meta.bag).name},
        version=__version__,
    )


def _outcome(out: Path, spec: CellSpec, truth: Path | None, dead: bool) -> Outcome:
    outcome = Outcome(digest=spec.digest(), scores=Scores(status="ok"))
    place = out / spec.directory
    place.mkdir(parents=True)
    for name in (TRAJECTORY_FILE, DIAGNOSTICS_FILE, "run.json"):
        with suppress(OSError):
            shutil.copyfile(out / NODES / spec.variant / name, place / name)
    if dead:
        outcome.scores.fail("the node died")
    with suppress(DataError):
        _note_diagnostics(outcome, place / DIAGNOSTICS_FILE)
    try:
        _score(outcome.scores, place, truth)
    except (DataError, ConfigError) as err:
        outcome.scores.fail(str(err).replace(f"{place}/", ""))
    text = outcome.model_dump_json(indent=2) + "\n"
    (place / CELL_FILE).write_text(text, encoding="utf-8")
    return outcome


def _note_diagnostics(outcome: Outcome, file: Path) -> None:
    columns = processed(read_diagnostics(file))
    scores = outcome.scores
    offered, accepted = (_sum(columns.get(key)) for key in ("offered", "accepted"))
    scores.accepted_share = accepted / offered if offered > 0.0 else None
    scores.lambda_t_min = median(columns.get("lambda_t_1"))
    scores.lambda_r_min = median(columns.get("lambda_r_1"))
    outcome.costs = _costs(columns)


def _sum(values: np.ndarray | None) -> float:
    return float(np.nansum(values)) if values is not None and values.dtype.kind == "f" else 0.0


def _costs(columns: dict[str, np.ndarray]) -> Costs:
    times = {
        name[len("time_") : -len("_ms")]: values[np.isfinite(values)]
        for name, values in columns.items()
        if name.startswith("time_") and name.endswith("_ms") and values.dtype.kind == "f"
    }
    total = times.pop("total", np.empty(0))
    return Costs(
        ms_per_scan_mean=float(total.mean()) if len(total) else None,
        ms_per_scan_median=float(np.median(total)) if len(total) else None,
        ms_per_scan_p95=float(np.percentile(total, 95)) if len(total) else None,
        stages={name: float(values.mean()) for name, values in times.items() if len(values)},
        cpu=cpu_model(),
        cores=os.cpu_count(),
    )


def _score(scores: Scores, place: Path, truth: Path | None) -> None:
    estimate = place / TRAJECTORY_FILE
    if not estimate.is_file() or estimate.stat().st_size == 0:
        scores.fail("no trajectory")
        return
    poses = read_tum(estimate)
    scores.scans_processed = len(poses)
    if len(poses) < MIN_POSES:
        scores.fail("no trajectory")
        return
    scores.duration_s = float(poses.stamps[-1] - poses.stamps[0]) * 1e-9
    if truth is None:
        if not finite(poses).all():
            scores.fail("poses that are not finite")
        return
    shutil.copyfile(truth, place / TRUTH_FILE)
    result, curves = evaluate(estimate, place / TRUTH_FILE, EvaluateOptions(out=place))
    note_scores(scores, result)
    if curves is not None:
        scores.best_time_shift_s = best_time_shift(estimate, place / TRUTH_FILE)
