# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Short tables from Google Benchmark's JSON files: `python -m d2lio.bench_summary FILE...`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table

STAGES = ("preprocess", "deskew", "downsample", "search", "update", "map", "total")
HOSTS = {
    "BM_ScanOff": "FAST-LIO2, off",
    "BM_ScanPointAdaptivePaper": "FAST-LIO2, adaptive, prior",
}
STREET_HOSTS = {
    "BM_ScanLioSam": "LIO-SAM",
    "BM_ScanD2LioOff": "D²-LIO, off, no prior",
    "BM_ScanD2Lio": "D²-LIO",
}
COST_GOAL_PERCENT = 2.0
PLUGIN_COSTS = (
    ("FAST-LIO2", "BM_PluginCost", f"; goal <= {COST_GOAL_PERCENT:g} %"),
    ("D²-LIO", "BM_LioSamPluginCost", ""),
)
NOISE_AWARE_SCENES = {"0": "room", "3": "vaulted tunnel"}  # by radius of the tunnel, m
SCAN_PERIOD_MS = 100.0  # of a VLP-16 at 10 Hz
PERIOD_SHARE = 0.5  # of the scan period that D2-LIO may take on one core
WIDTH = 110  # columns where the output is no terminal
TO_MS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}

Entry = dict[str, Any]


def load(paths: list[Path]) -> list[Entry]:
    """The measured runs of all files; aggregates such as means are left out."""
    entries: list[Entry] = []
    for path in paths:
        entries += json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
    return [e for e in entries if e.get("run_type", "iteration") == "iteration"]


def _named(entries: list[Entry], prefix: str) -> list[Entry]:
    return [e for e in entries if e["name"].split("/")[0] == prefix]


def stage_table(entries: list[Entry]) -> Table:
    """Time per scan by stage, ms: one row per host setting and thread count."""
    table = Table(title="a room: time per scan, ms (28 800 raw points)")
    table.add_column("host")
    for column in ("threads", *STAGES):
        table.add_column(column, justify="right")
    for prefix, label in HOSTS.items():
        for entry in _named(entries, prefix):
            threads = entry["name"].split("/")[1]
            table.add_row(label, threads, *(f"{entry[s + '_ms']:.2f}" for s in STAGES))
    return table


def street_table(entries: list[Entry]) -> Table:
    """Time per scan of a street drive, one thread, ms: one row per host and speed."""
    table = Table(title="a street, one thread: time per scan, ms")
    table.add_column("host")
    for column in ("m/s", *STAGES[:-1], "mean", "p95", "CPU"):
        table.add_column(column, justify="right")
    for prefix, label in STREET_HOSTS.items():
        for entry in _named(entries, prefix):
            if entry.get("error_occurred"):
                table.add_row(label, _speed(entry), str(entry.get("error_message", "failed")))
                continue
            keys = [f"{stage}_ms" for stage in STAGES[:-1]] + ["mean_ms", "p95_ms", "cpu_ms"]
            table.add_row(label, _speed(entry), *(f"{entry[key]:.2f}" for key in keys))
    return table


def _speed(entry: Entry) -> str:
    """The benchmark's argument, m/s, as in BM_X/speed:8/iterations:60/manual_time."""
    return entry["name"].split("/")[1].removeprefix("speed:")


def period_share(entries: list[Entry]) -> list[str]:
    """D²-LIO's mean time per scan against half the scan period, one line a speed."""
    lines = []
    goal = PERIOD_SHARE * SCAN_PERIOD_MS
    for entry in _named(entries, "BM_ScanD2Lio"):
        head = f"D²-LIO per VLP-16 scan at {_speed(entry)} m/s: "
        if entry.get("error_occurred"):
            lines.append(f"{head}FAIL: {entry.get('error_message', 'failed')}")
            continue
        ms, cpu = entry["mean_ms"], entry["cpu_ms"]
        lines.append(
            f"{head}{'PASS' if ms < goal else 'FAIL'}: {ms:.1f} ms on one core ({cpu:.1f} ms of "
            f"CPU time) is {ms / goal:.2f} of half the scan period ({goal:.0f} ms)"
        )
    return lines or ["D²-LIO per VLP-16 scan: not measured (built without GTSAM)"]


def plugin_cost(entries: list[Entry]) -> list[str]:
    """Cost of gate and prior as a share of search and update: median over the repetitions."""
    lines = []
    for host, benchmark, goal in PLUGIN_COSTS:
        shares = [e["share_percent"] for e in _named(entries, benchmark) if "share_percent" in e]
        if not shares:
            lines.append(f"{host}: gate and prior: not measured")
            continue
        spread = f"{min(shares):.1f} … {max(shares):.1f}"
        lines.append(
            f"{host}: gate and prior cost {median(shares):.1f} % of search and update "
            f"(median of {len(shares)}, {spread}{goal})"
        )
    return lines


def noise_aware_cost(entries: list[Entry]) -> list[str]:
    """Cost of method noise_aware in FAST-LIO2: medians over the repetitions, one line a scene."""
    lines = []
    for radius, scene in NOISE_AWARE_SCENES.items():
        found = [
            e
            for e in _named(entries, "BM_NoiseAwareCost")
            if e["name"].split("/")[1] == f"pipe:{radius}"
        ]
        if not found:
            lines.append(f"FAST-LIO2, noise_aware, {scene}: not measured")
            continue
        shares = [e["share_percent"] for e in found]
        lines.append(
            f"FAST-LIO2, noise_aware, {scene}: {median(shares):.1f} % of search and update on top "
            f"(median of {len(shares)}, {min(shares):.1f} … {max(shares):.1f}; the same scan and "
            "map as with none)"
        )
    return lines


def analysis_cost(entries: list[Entry]) -> str:
    """Absolute cost of the degeneracy analysis, which the host makes in every mode."""
    found = _named(entries, "BM_Condition")
    if not found:
        return "degeneracy analysis: not measured"
    us = found[0]["cpu_time"] * TO_MS[found[0]["time_unit"]] * 1e3
    return (
        f"degeneracy analysis and prior rows, 1000 correspondences: {us:.1f} us an iteration "
        "(analysis is in every mode, for the diagnostics)"
    )


def _size_label(points: str) -> str:
    count = int(points)
    return f"{count // 1_000_000}M" if count >= 1_000_000 else f"{count // 1000}k"


def tree_table(entries: list[Entry]) -> Table:
    """ikd-tree operations by map size, with bytes per point."""
    operations = ("bm_build", "bm_insert_downsampled", "bm_erase_box", "bm_knn5")
    sizes = sorted({e["name"].split("/")[1] for e in _named(entries, "bm_build")}, key=int)
    table = Table(title="ikd-tree")
    table.add_column("points")
    for title in ("build ms", "insert a scan ms", "delete a box ms", "5-NN us", "bytes/point"):
        table.add_column(title, justify="right")
    for size in sizes:
        cells = []
        for name in operations:
            found = [e for e in _named(entries, name) if e["name"].split("/")[1] == size]
            ms = found[0]["cpu_time"] * TO_MS[found[0]["time_unit"]] if found else float("nan")
            cells.append(f"{ms * 1e3:.2f}" if name == "bm_knn5" else f"{ms:.3f}")
        built = next(e for e in _named(entries, "bm_build") if e["name"].split("/")[1] == size)
        cells.append(f"{built.get('bytes_per_point', float('nan')):.0f}")
        table.add_row(_size_label(size), *cells)
    return table


def main(arguments: list[str]) -> int:
    """Prints the tables; 2 when a file is missing."""
    paths = [Path(a) for a in arguments]
    missing = [str(p) for p in paths if not p.is_file()]
    if missing or not paths:
        print(f"bench_summary: no such file: {', '.join(missing) or '-'}", file=sys.stderr)
        return 2
    entries = load(paths)
    console = Console() if sys.stdout.isatty() else Console(width=WIDTH)
    console.print(stage_table(entries))
    street = street_table(entries)
    if street.row_count:
        console.print(street)
    console.print(tree_table(entries))
    for line in (*period_share(entries), *plugin_cost(entries), *noise_aware_cost(entries)):
        console.print(line, highlight=False)
    console.print(analysis_cost(entries))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
