# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""End errors in the bare tunnel beside those of an ideal inertial navigator.

Nothing in a bare tunnel shows the motion along it: an estimator is as good as its IMU there. The
bound is what the IMU allows with the true orientation: the accelerometer's bias from the
standstill, then dead reckoning. `python -m d2lio.bare_tunnel --seeds 20`.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from d2lio.datasets import ImuBlock, Source, open_source
from d2lio.datasets.events import NS_PER_S, Float64, Int64
from d2lio.errors import DataError
from d2lio.metrics import Trajectory, read_tum
from d2lio.metrics.tum import interpolate
from d2lio.output import replace_file
from d2lio.seeds import MAX_GAP_S, REJECTION, Track, built_hosts, pose_errors, track
from d2lio.simulator import simulate
from d2lio.simulator.imu import GRAVITY
from d2lio.simulator.pipeline import TRUTH_FILE
from d2lio.simulator.trajectory import STANDSTILL

WORLD_GRAVITY = np.array([0.0, 0.0, -GRAVITY])


class EndError(NamedTuple):
    """Error of the last pose with the first one aligned, m.

    Attributes:
        along: signed, on the line from the first to the last true position.
        across: distance from that line's end at right angles to it.
        sigma_along: what the host says of `along`, 1 sigma.
    """

    along: float
    across: float
    sigma_along: float


@dataclass(frozen=True, slots=True)
class Row:
    """The signed bound of a seed, m, and one host's end error beside it."""

    seed: int
    host: str
    bound: float
    error: EndError


def dead_reckoning_error(
    stamps: Int64, accel: Float64, truth: Trajectory, standstill: float = STANDSTILL
) -> float:
    """End error of the ideal navigator along the line from the first to the last position, m.

    Args:
        stamps: of the samples, int64 [N] ns.
        accel: specific force in the body, float64 [N, 3] m/s^2.
        truth: T_world_imu, z up, the simulator's gravity; samples outside its times are left out.
        standstill: s from the truth's first pose on in which the body rests.

    Raises:
        DataError: no sample while the body rests, or none of its motion.
    """
    inside = (stamps >= truth.stamps[0]) & (stamps <= truth.stamps[-1])
    stamps, accel = stamps[inside], accel[inside]
    poses = interpolate(truth, stamps, MAX_GAP_S)
    seconds = (stamps - truth.stamps[0]) / NS_PER_S
    rest = seconds < standstill
    if len(poses) < len(stamps) or not rest.any() or rest.all():
        raise DataError("the bound needs a standstill, a motion and ground truth all along")
    to_world = Rotation.from_quat(poses.quaternions)
    bias = (accel[rest] + to_world[rest].inv().apply(WORLD_GRAVITY)).mean(axis=0)
    moving = to_world.apply(accel - bias) + WORLD_GRAVITY
    moving[rest] = 0.0
    velocity = cumulative_trapezoid(moving, seconds, axis=0, initial=0.0)
    travelled = cumulative_trapezoid(velocity, seconds, axis=0)[-1]
    motion = poses.positions[-1] - poses.positions[0]
    return float((travelled - motion) @ motion / np.linalg.norm(motion))


def bound(source: Source, truth: Trajectory) -> float:
    """`dead_reckoning_error` of a simulated recording, m."""
    blocks = [event for event in source.reader.raw_events() if isinstance(event, ImuBlock)]
    stamps = np.concatenate([block.stamps for block in blocks])
    accel = np.concatenate([block.accel for block in blocks])
    return dead_reckoning_error(stamps, accel, truth)


def end_error(estimate: Track, truth: Trajectory) -> EndError:
    """Error of the last pose after aligning position and orientation of the first one.

    Raises:
        DataError: the truth does not cover the estimate.
    """
    positions = estimate.trajectory.positions
    error = pose_errors(estimate, truth)[-1, :3]
    motion = positions[-1] - positions[0] - error  # the true one, in the map
    axis = motion / np.linalg.norm(motion)
    along = float(error @ axis)
    variance = float(axis @ estimate.covariance[-1, :3, :3] @ axis)
    return EndError(along, float(np.linalg.norm(error - along * axis)), math.sqrt(variance))


def measure(seed: int, hosts: Sequence[str], duration: float | None = None) -> list[Row]:
    """Simulates one tunnel into a temporary folder, computes its bound and runs the hosts."""
    with tempfile.TemporaryDirectory(prefix="d2lio-tunnel-") as folder:
        place = Path(folder) / "tunnel"
        simulate("tunnel", place, seed=seed, duration=duration)
        truth = read_tum(place / TRUTH_FILE)
        limit = bound(open_source(place), truth)
        rows = []
        for host in hosts:
            estimate = track(open_source(place), host, REJECTION[host])
            rows.append(Row(seed, host, limit, end_error(estimate, truth)))
    return rows


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """The CSV file, in one go: it is whole at any moment."""
    lines = ["seed,host,bound_m,along_m,across_m,sigma_along_m"]
    lines += [f"{r.seed},{r.host},{','.join(map(repr, (r.bound, *r.error)))}" for r in rows]
    replace_file(path, "\n".join(lines) + "\n")


def summary(rows: Sequence[Row]) -> Table:
    """Medians over the seeds by host, the bound first, m."""
    made = Table(title="bare tunnel: error at the end, m")
    made.add_column("")
    for column in ("seeds", "median along", "/ bound", "worst along", "worst across", "in 3 sigma"):
        made.add_column(column, justify="right")
    limits = list({row.seed: abs(row.bound) for row in rows}.values())
    limit = float(np.median(limits))
    made.add_row("bound", f"{len(limits)}", f"{limit:.2f}", "1.00", f"{max(limits):.2f}", "", "")
    for host in dict.fromkeys(row.host for row in rows):
        errors = [row.error for row in rows if row.host == host]
        along = np.abs([error.along for error in errors])
        median = float(np.median(along))
        covered = sum(abs(error.along) < 3.0 * error.sigma_along for error in errors)
        made.add_row(
            host, f"{len(errors)}", f"{median:.2f}", f"{median / limit:.2f}", f"{along.max():.2f}",
            f"{max(error.across for error in errors):.3f}", f"{covered} of {len(errors)}",
        )  # fmt: skip
    return made


def main(arguments: list[str]) -> int:
    """Prints seed by seed, then the table; hosts that are not built are said and left out."""
    parser = argparse.ArgumentParser(prog="python -m d2lio.bare_tunnel")
    parser.add_argument("--seeds", type=int, default=20, help="0 to this, exclusive")
    parser.add_argument("--hosts", default=",".join(REJECTION), help="separated by commas")
    parser.add_argument("--duration", type=float, help="s; default of the scene: 60 m")
    parser.add_argument("--out", type=Path, help="CSV file")
    options = parser.parse_args(arguments)
    console = Console() if sys.stdout.isatty() else Console(width=110)
    hosts = built_hosts(parser, options, console)
    rows: list[Row] = []
    for seed in range(options.seeds if hosts else 0):
        rows += measure(seed, hosts, options.duration)
        for row in rows[-len(hosts) :]:
            console.print(
                f"seed {seed}, {row.host}: along {row.error.along:+.2f} m (bound {row.bound:+.2f}, "
                f"sigma {row.error.sigma_along:.2f}), across {row.error.across:.3f} m",
                highlight=False,
            )
        if options.out is not None:
            write_rows(options.out, rows)
    if rows:
        console.print(summary(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
