# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The data that an ablation's page carries: what its script draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from d2lio.ablate.results import Key, ResultRow, Results
from d2lio.ablate.suite import Variant
from d2lio.ablate.tables import POOLED_ID, Table
from d2lio.report import cloud, palette
from d2lio.report.diagnostics import OUTCOMES, RANGES
from d2lio.report.embed import pack, stride
from d2lio.report.series import RunSeries

MAX_POINTS = 400  # per curve
MIN_POINTS = 60
CURVES_BYTES = 7_500_000  # of all curves together, before the number of points is lowered
BYTES_PER_POINT = 8 * 2.7  # eight packed curves of a run
SHOWN = 6  # variants drawn at first: as many as there are colours
HIDDEN_STAGES = ("total",)
# Files of a run that a reader may open, as far as they are there.
FILES = (
    "trajectory.tum", "truth.tum", "diagnostics.csv", "run.json", "cell.json", "run.log",
    "trajectory.matched_truth.tum", "trajectory.matched_estimate.tum",
)  # fmt: skip


def points_per_curve(cells: int) -> int:
    """So many that a page of 1000 cells stays below some 15 MB."""
    return int(np.clip(CURVES_BYTES / BYTES_PER_POINT / max(cells, 1), MIN_POINTS, MAX_POINTS))


def meta(results: Results, tables: Sequence[Table]) -> dict[str, Any]:
    """What the page knows from its start."""
    suite = results.suite
    present = {row.variant for row in results.rows}
    variants = [v for v in suite.variants if v.id in present]
    numbers = {v.id: index for index, v in enumerate(variants)}
    sequences = _sequences(results)
    places = {s["name"]: index for index, s in enumerate(sequences)}
    stages = _stage_names(results)
    files, runs = _runs(results, places, numbers)
    baselines = dict.fromkeys(table.baseline for table in tables if table.baseline)
    shown = _shown_first(results, list(numbers))
    return {
        "variants": [_look(v, index, v.id in shown) for index, v in enumerate(variants)],
        "sequences": sequences,
        "runs": runs,
        "files": files,
        "baseline": " or ".join(title_of(results, b) for b in baselines) or "the baseline",
        "differences": _differences(tables, places, numbers),
        "outcomes": list(OUTCOMES.values()),
        "outcome_colours": palette.OUTCOME_COLOURS,
        "ranges": list(RANGES.values()),
        "stages": stages,
        "stage_colours": palette.STAGE_COLOURS,
        "timing": [_timing(results, v.id, stages) for v in variants],
        "truth": palette.TRUTH,
    }


def _look(variant: Variant, index: int, shown: bool) -> dict[str, Any]:
    style = palette.style(index)
    return {
        "title": _title(variant), "colour": style.colour, "dash": style.dash, "shown": shown
    }  # fmt: skip


def _shown_first(results: Results, order: Sequence[str]) -> set[str]:
    """The first SHOWN variants of every sequence."""
    own: dict[str, set[str]] = {}
    for row in results.rows:
        own.setdefault(row.sequence, set()).add(row.variant)
    return {v for there in own.values() for v in [x for x in order if x in there][:SHOWN]}


def _title(variant: Variant) -> str:
    """The label, with the group where other groups may have the same label."""
    label = variant.label
    return f"{variant.group}: {label}" if variant.group and variant.group not in label else label


def title_of(results: Results, variant: str) -> str:
    """A variant as figures name it."""
    return _title(results.suite.variant(variant))


def _sequences(results: Results) -> list[dict[str, Any]]:
    repeats: dict[str, set[int]] = {}
    for row in results.rows:
        repeats.setdefault(row.sequence, set()).add(row.repeat)
    return [
        {"name": s.name, "dataset": s.dataset, "repeats": sorted(repeats[s.name])}
        for s in results.suite.sequences
        if s.name in repeats
    ]


def _runs(
    results: Results, places: Mapping[str, int], numbers: Mapping[str, int]
) -> tuple[list[str], list[dict[str, Any]]]:
    """Names of files that occur, and every run with the indices of those that it has."""
    names: dict[str, int] = {}
    runs = []
    for row in results.rows:
        place = results.out / row.directory
        there = [f for f in FILES if row.directory and _has_content(place / f)]
        runs.append(
            {
                "sequence": places[row.sequence],
                "repeat": row.repeat,
                "variant": numbers[row.variant],
                "ate": _number(row.ate_m),
                "reason": "" if row.status == "ok" else row.reason or "failed",
                "directory": row.directory,
                "files": [names.setdefault(name, len(names)) for name in there],
            }
        )
    return list(names), runs


def _has_content(file: Path) -> bool:
    try:
        return file.stat().st_size > 0
    except OSError:
        return False


def _number(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return float(f"{value:.9g}")


def _differences(
    tables: Sequence[Table], places: Mapping[str, int], numbers: Mapping[str, int]
) -> list[list[float | int | None]]:
    """Sequence, variant, ratio of ATEs and its bounds, of every cell that has them."""
    found: list[list[float | int | None]] = []
    for table in tables:
        for (row, column), cell in table.cells.items():
            sequence, variant = (row, column) if column in numbers else (column, row)
            d = cell.difference
            if d is None or POOLED_ID in (row, column):
                continue
            bounds = [None if b is None else _number(math.exp(b)) for b in (d.low, d.high)]
            ratio = _number(math.exp(d.log_ratio))
            found.append([places[sequence], numbers[variant], ratio, *bounds])
    return found


def _stage_names(results: Results) -> list[str]:
    names = dict.fromkeys(name for t in results.timings.values() for name in t.stages)
    return [name for name in names if name not in HIDDEN_STAGES]


def _timing(results: Results, variant: str, stages: Sequence[str]) -> dict[str, Any]:
    rows = [t for key, t in results.timings.items() if key[2] == variant]
    medians = [t.ms_per_scan_median for t in rows if t.ms_per_scan_median is not None]
    means = []
    for stage in stages:
        values = [v for t in rows if (v := t.stages.get(stage)) is not None]
        means.append(_number(float(np.mean(values))) if values else None)
    known = any(value is not None for value in means)
    return {"box": [_number(m) for m in medians], "stages": means if known else None}


def sequence_data(
    results: Results, number: int, series: Mapping[Key, RunSeries], points: int
) -> dict[str, Any]:
    """Curves of one sequence, packed, by repeat and variant; the map of its first repeat."""
    name = _sequences(results)[number]["name"]
    present = {row.variant for row in results.rows}
    numbers = {v.id: i for i, v in enumerate(v for v in results.suite.variants if v.id in present)}
    repeats: dict[int, dict[str, Any]] = {}
    first: tuple[int, np.ndarray] | None = None
    for row in results.rows:
        if row.sequence != name or row.key not in series:
            continue
        run = series[row.key]
        entry = repeats.setdefault(row.repeat, {"truth": None, "runs": {}})
        if entry["truth"] is None and len(run.truth):
            entry["truth"] = _points(run.truth, points)
            first = first or (row.repeat, run.truth)
        entry["runs"][numbers[row.variant]] = _curves(run, points)
    data: dict[str, Any] = {"repeats": repeats}
    if first is not None:
        surroundings = cloud.load_map(results.out, results.suite.sequence(name), *first)
        data["map"] = _points(surroundings, len(surroundings))
    return data


def _points(positions: np.ndarray, most: int) -> dict[str, Any]:
    thin = positions[:: stride(len(positions), most)]
    return {axis: pack(thin[:, k]) for k, axis in enumerate("xyz")}


def _curves(run: RunSeries, points: int) -> dict[str, Any]:
    path, scan = stride(len(run.t), points), stride(len(run.t_scan), points)
    curves: dict[str, Any] = {}
    if len(run.t):
        curves = _points(run.path, points)
        curves |= {"t": pack(run.t[::path]), "e": pack(run.error[::path], log=True)}
    if run.restart is not None:
        R, t = run.restart
        curves["m"] = [_number(float(v)) for v in np.column_stack([R, t]).ravel()]
    if len(run.lambda_t) and len(run.lambda_r):
        curves |= {
            "s": pack(run.t_scan[::scan]),
            "lt": pack(run.lambda_t[::scan], log=True),
            "lr": pack(run.lambda_r[::scan], log=True),
        }
    if run.shares:
        curves["o"] = [round(run.shares.get(label, 0.0), 5) for label in OUTCOMES.values()]
    if run.rejected_by_range:
        curves["b"] = [_number(v) if v is not None else None for v in run.rejected_by_range]
    return {key: value for key, value in curves.items() if value is not None}


def runs_with_files(results: Results) -> list[tuple[ResultRow, Path]]:
    """Every run that has a directory."""
    return [
        (row, results.out / row.directory)
        for row in results.rows
        if row.directory and (results.out / row.directory).is_dir()
    ]
