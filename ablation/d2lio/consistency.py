# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Whether the covariance that a host publishes covers its error, over seeds of simulated scenes.

The normalised estimation error squared (NEES, Bar-Shalom, Li, Kirubarajan, Estimation with
Applications to Tracking and Navigation, 2001, section 5.4) of the pose relative to the first one:
its mean over seeds, by the degrees of freedom, is 1 for an honest covariance, more for one that is
over-confident. `python -m d2lio.consistency --seeds 5`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import chi2

from d2lio.datasets import open_source
from d2lio.datasets.events import Float64
from d2lio.metrics import read_tum
from d2lio.seeds import METHOD, REJECTION, built_hosts, pose_errors, track
from d2lio.simulator import simulate
from d2lio.simulator.pipeline import TRUTH_FILE

SCENES = ("room", "tunnel_cabinets", "tunnel")
POSE, BLOCK = 6, 3  # degrees of freedom
CONFIDENCE = 0.95
MOMENTS = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the sequence's length


class Nees(NamedTuple):
    """NEES of every pose, each float64 [N]: chi-square with 6, 3 and 3 degrees of freedom."""

    pose: Float64
    position: Float64
    rotation: Float64


def nees(errors: Float64, covariance: Float64) -> Nees:
    """Of errors [N, 6] and their covariances [N, 6, 6]; NaN where one is not positive definite."""

    def of(block: slice) -> Float64:
        e, c = errors[:, block], covariance[:, block, block]
        out = np.full(len(e), np.nan)
        for i in range(len(e)):
            if np.linalg.eigvalsh(c[i])[0] > 0.0:
                out[i] = e[i] @ np.linalg.solve(c[i], e[i])
        return out

    return Nees(of(slice(0, POSE)), of(slice(0, BLOCK)), of(slice(BLOCK, POSE)))


def band(seeds: int, freedom: int = POSE) -> tuple[float, float]:
    """Where the mean over seeds of an honest NEES, by its freedom, lies in 95 of 100 cases."""
    total = seeds * freedom
    low, high = chi2.ppf([0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], total) / total
    return float(low), float(high)


def measure(
    scene: str, seed: int, hosts: Sequence[str], duration: float | None = None
) -> dict[str, Nees]:
    """NEES by host at MOMENTS of one sequence, which is simulated into a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="d2lio-consistency-") as folder:
        place = Path(folder) / scene
        simulate(scene, place, seed=seed, duration=duration)
        truth = read_tum(place / TRUTH_FILE)
        found = {}
        for host in hosts:
            estimate = track(open_source(place), host, REJECTION[host], METHOD)
            last = len(estimate.trajectory) - 1
            moments = np.rint(np.array(MOMENTS) * last).astype(int)
            errors = pose_errors(estimate, truth)[moments]
            found[host] = nees(errors, estimate.covariance[moments])
        return found


def summary(found: dict[tuple[str, str], list[Nees]], seeds: int) -> Table:
    """Mean NEES over seeds by freedom, moment by moment for the pose, then the moments' means."""
    low, high = band(seeds)
    made = Table(title=f"NEES / freedom, {seeds} seeds; honest: {low:.2f} to {high:.2f} (pose)")
    made.add_column("")
    for moment in MOMENTS:
        made.add_column(f"{moment:.0%}", justify="right")
    for column in ("pose", "position", "rotation"):
        made.add_column(column, justify="right")
    for (scene, host), rows in found.items():
        pose = np.mean([row.pose for row in rows], axis=0) / POSE
        blocks = [np.mean([getattr(r, k) for r in rows]) / BLOCK for k in ("position", "rotation")]
        cells = [*pose, pose.mean(), *blocks]
        made.add_row(f"{scene}, {host}", *(f"{cell:.2f}" for cell in cells))
    return made


def main(arguments: list[str]) -> int:
    """Prints the table; hosts that are not built are said and left out."""
    parser = argparse.ArgumentParser(prog="python -m d2lio.consistency")
    parser.add_argument("--scenes", default=",".join(SCENES), help="separated by commas")
    parser.add_argument("--seeds", type=int, default=5, help="how many")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--hosts", default=",".join(REJECTION), help="separated by commas")
    parser.add_argument("--duration", type=float, help="s; default: each scene's own")
    options = parser.parse_args(arguments)
    console = Console() if sys.stdout.isatty() else Console(width=110)
    hosts = built_hosts(parser, options, console)
    found: dict[tuple[str, str], list[Nees]] = {}
    for scene in options.scenes.split(",") if hosts else ():
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            for host, result in measure(scene, seed, hosts, options.duration).items():
                found.setdefault((scene, host), []).append(result)
    if found:
        console.print(summary(found, options.seeds))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
