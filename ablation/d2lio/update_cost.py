# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Time of a host's update, scan by scan, with and without the handling of weak directions.

The update is search, rows and filter; each method runs on one thread with a map of its own. Of each
scan counts the quickest of several runs, which other programs disturbed least. What the method adds
to one and the same update is the benchmark BM_NoiseAwareCost; this is what a drive takes.
`python -m d2lio.update_cost --scenes room,tunnel_cabinets`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from d2lio.datasets import Source, open_source
from d2lio.datasets.events import Float64, Int64
from d2lio.errors import DataError
from d2lio.seeds import METHOD, REJECTION, built_hosts, scans
from d2lio.simulator import simulate

SCENES = ("room", "dense_street", "offroad", "tunnel_cabinets", "corridor", "bridge", "waterway")
BASE = "none"
STAGES = ("time_search_ms", "time_update_ms")


@dataclass(frozen=True, slots=True)
class Cost:
    """Mean time of the update over a drive, ms, and mean number of iterations, by method."""

    scene: str
    host: str
    base_ms: float
    method_ms: float
    base_iterations: float
    method_iterations: float

    @property
    def percent(self) -> float:
        """What the method adds, in percent of the update without it."""
        return 100.0 * (self.method_ms / self.base_ms - 1.0)


def time_updates(source: Source, host: str, method: str) -> tuple[Int64, Float64]:
    """Stamps of the scans with a pose, int64 [N] ns, and of each the wall time of its update (ms)
    and its iterations, float64 [N, 2].

    Raises:
        DataError: no scan gave a pose.
    """
    results = list(scans(source, host, REJECTION[host], method))
    if not results:
        raise DataError(f"{source.name}: {host} gave no pose")
    figures = [
        [sum(r.diagnostics[stage] for stage in STAGES), r.diagnostics["iterations"]]
        for r in results
    ]
    return np.array([r.stamp for r in results]), np.array(figures, dtype=float)


def compare(source: Source, scene: str, host: str, repeats: int) -> Cost:
    """Runs both methods over a recording in turn; scans without a pose of either are left out."""
    stamps: dict[str, Int64] = {}
    best: dict[str, Float64] = {}
    for _ in range(repeats):
        for method in (BASE, METHOD):
            stamps[method], figures = time_updates(source, host, method)
            best[method] = np.minimum(best.get(method, figures), figures)
    _, *common = np.intersect1d(stamps[BASE], stamps[METHOD], return_indices=True)
    (base_ms, base_iterations), (ours_ms, ours_iterations) = (
        best[method][rows].mean(axis=0) for method, rows in zip((BASE, METHOD), common, strict=True)
    )
    return Cost(scene, host, base_ms, ours_ms, base_iterations, ours_iterations)


def summary(costs: Sequence[Cost]) -> Table:
    """One row per scene and host."""
    made = Table(title="search and update per scan")
    made.add_column("scene")
    made.add_column("host")
    for column in (f"{BASE}, ms", f"{METHOD}, ms", "change", "iterations"):
        made.add_column(column, justify="right")
    for cost in costs:
        made.add_row(
            cost.scene, cost.host, f"{cost.base_ms:.2f}", f"{cost.method_ms:.2f}",
            f"{cost.percent:+.1f} %", f"{cost.base_iterations:.1f} → {cost.method_iterations:.1f}",
        )  # fmt: skip
    return made


def main(arguments: list[str]) -> int:
    """Prints the table; hosts that are not built are said and left out."""
    parser = argparse.ArgumentParser(prog="python -m d2lio.update_cost")
    parser.add_argument("--scenes", default=",".join(SCENES), help="separated by commas")
    parser.add_argument("--hosts", default=",".join(REJECTION), help="separated by commas")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the quickest counts")
    parser.add_argument("--duration", type=float, help="s; default of each scene")
    parser.add_argument("--seeds", type=int, default=1, help="0 to this, exclusive")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    console = Console() if sys.stdout.isatty() else Console(width=110)
    hosts = built_hosts(parser, options, console)
    costs: list[Cost] = []
    for scene in options.scenes.split(","):
        for seed in range(options.seeds):
            with tempfile.TemporaryDirectory(prefix="d2lio-cost-") as folder:
                place = Path(folder) / scene
                simulate(scene, place, seed=seed, duration=options.duration)
                source = open_source(place)
                costs += [compare(source, scene, host, options.repeats) for host in hosts]
    console.print(summary(costs))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
