# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""An ablation that nobody ran: rows, timings and run directories made up from a seed."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from d2lio.ablate.results import SUITE_FILE, ResultRow, Results, TimingRow, save
from d2lio.ablate.suite import Suite, slug
from d2lio.output import tum_line
from d2lio.report.diagnostics import RANGES

START_NS = 1_700_000_000_000_000_000
PATH_M = 60.0
STAGES = ("preprocess", "deskew", "search", "update", "map", "total")
REASONS = ("crashed (SIGSEGV)", "time limit of 600 s <reached>", "ATE 20.0 % of the path")

VARIANTS = [
    {"id": "fastlio", "title": "FAST-LIO2", "host": "fastlio", "rejection": "off"},
    {"id": "liosam", "title": "LIO-SAM", "host": "liosam", "rejection": "off"},
    {"id": "d2lio", "title": "D²-LIO", "host": "d2lio", "degeneracy": "paper"},
    {"id": "voxelmap", "title": "VoxelMap", "import": "voxelmap"},
]
SEQUENCES = [
    {"name": "Tunnel-2", "dataset": "GEODE", "simulate": {"scene": "tunnel_cabinets"}},
    {"name": "Flat Ground", "dataset": "GEODE", "simulate": {"scene": "flat_ground"}},
    {"name": "Highway_day_easy_a", "dataset": "ECMD", "simulate": {"scene": "highway"}},
]
PAPER = {
    "table": "table2.csv",
    "columns": {"fastlio": "FAST-LIO2", "liosam": "LIO-SAM", "d2lio": "D2-LIO"},
}


def suite(**changes: object) -> Suite:
    """A suite of three sequences and four variants."""
    data: dict = {
        "name": "fake",
        "title": "Made up: ATE RMSE, m",
        "repeats": 5,
        "baseline": "fastlio",
        "sequences": SEQUENCES,
        "variants": VARIANTS,
        "paper": PAPER,
    }
    return Suite.parse(data | changes)


def row(sequence: str, repeat: int, variant: str, ate: float | None, **more: object) -> ResultRow:
    """A good run with that ATE, or a failed one where it is beyond the limit or None."""
    failed = ate is None or ate > 0.05 * PATH_M
    values: dict = {
        "suite": "fake",
        "sequence": sequence,
        "repeat": repeat,
        "seed": repeat,
        "variant": variant,
        "status": "fail" if failed else "ok",
        "reason": REASONS[repeat % 2 if ate is None else 2] if failed else "",
        "coverage": None if ate is None else 1.0,
        "ate_m": ate,
        "ate_percent": None if ate is None else 100.0 * ate / PATH_M,
        "path_m": PATH_M,
        "directory": f"runs/{slug(sequence)}/r{repeat}/{variant}",
        "version": "0.1.0",
    }
    return ResultRow(**(values | more))


def results(rows: list[ResultRow], out: Path = Path(), **changes: object) -> Results:
    """Results with those rows and no files."""
    return Results(suite(**changes), rows, {}, out)


def ablation(out: Path, plan: Suite | None = None, seed: int = 0, poses: int = 250) -> Results:
    """A whole ablation with run directories in `out`: D²-LIO halves the error, LIO-SAM fails."""
    plan = plan or suite()
    rng = np.random.default_rng(seed)
    rows, timings = [], []
    for number, sequence in enumerate(plan.sequences):
        for repeat in range(plan.repeats):
            for variant in plan.variants_of(sequence):
                scale = 0.1 if variant.host == "d2lio" else 0.2
                ate: float | None = scale * (1 + number) * float(rng.uniform(0.8, 1.2))
                if variant.host == "liosam" and (number == 1 or repeat == 3):
                    ate = (None, 12.0)[repeat % 2]
                cell = row(
                    sequence.name,
                    repeat,
                    variant.id,
                    ate,
                    dataset=sequence.dataset,
                    variant_title=variant.title,
                    host=variant.host or "",
                    degeneracy=variant.degeneracy or "",
                )
                rows.append(cell)
                if ate is not None:
                    timings.append(_timing(cell, rng))
                    _write_run(out / cell.directory, cell, poses, rng)
    out.mkdir(parents=True, exist_ok=True)
    (out / SUITE_FILE).write_text(plan.to_yaml(), encoding="utf-8")
    save(out, rows, timings)
    return Results(plan, rows, {t.key: t for t in timings}, out)


def _timing(cell: ResultRow, rng: np.random.Generator) -> TimingRow:
    stages = {name: float(rng.uniform(0.5, 5.0)) for name in STAGES[:-1]}
    total = sum(stages.values())
    peer = not cell.host
    return TimingRow(
        sequence=cell.sequence,
        repeat=cell.repeat,
        variant=cell.variant,
        wall_s=total,
        host_s=0.8 * total,
        read_s=0.1 * total,
        ms_per_scan_mean=total,
        ms_per_scan_median=0.9 * total,
        ms_per_scan_p95=1.5 * total,
        stages={} if peer else stages | {"total": total},
        peak_memory_mb=300.0,
        cpu="a processor",
        cores=2,
    )


def _write_run(place: Path, cell: ResultRow, poses: int, rng: np.random.Generator) -> None:
    place.mkdir(parents=True, exist_ok=True)
    t = np.linspace(0.0, 25.0, poses)
    truth = np.column_stack([PATH_M * t / 25.0, 5.0 * np.sin(0.2 * t), 0.3 * np.sin(0.5 * t)])
    drift = np.cumsum(rng.standard_normal((poses, 3)), axis=0)
    scale = (cell.ate_m or 0.0) / max(float(np.sqrt((drift**2).sum(axis=1).mean())), 1e-9)
    stamps = START_NS + np.round(t * 1e9).astype(np.int64)
    for name, positions in (("truth", truth), ("trajectory", truth + scale * drift)):
        lines = []
        for stamp, position in zip(stamps, positions, strict=True):
            pose = np.eye(4)
            pose[:3, 3] = position
            lines.append(tum_line(int(stamp), pose))
        (place / f"{name}.tum").write_text("".join(lines), encoding="utf-8")
    _write_diagnostics(place / "diagnostics.csv", stamps, bool(cell.host), rng)
    (place / "run.json").write_text("{}\n", encoding="utf-8")
    (place / "cell.json").write_text("{}\n", encoding="utf-8")


def _write_diagnostics(
    file: Path, stamps: np.ndarray, full: bool, rng: np.random.Generator
) -> None:
    header = ["stamp_ns", "status", "health", "time_total_ms"]
    if full:
        header += ["offered", "accepted", "rejected_threshold", "rejected_plane_fit"]
        header += ["lambda_r_1", "lambda_t_1"]
        header += [f"{kind}_{ending}" for ending in RANGES for kind in ("offered", "accepted")]
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for stamp in stamps:
            line = [stamp, "ok", "OK", f"{rng.uniform(5, 20):.3f}"]
            if full:
                line += [1000, 800, 150, 50, f"{rng.uniform(50, 500):.2f}"]
                line += [f"{rng.uniform(5, 50):.2f}"]
                line += [400, 380, 300, 240, 200, 140, 100, 40, 0, 0, 0, 0]
            writer.writerow(line)
