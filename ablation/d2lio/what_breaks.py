# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What breaks each method for weak directions, along the direction that no scan sees.

One simulated tunnel, every method in every host: error, smallest eigenvalue, velocity,
accelerometer bias and correction along the tunnel, scan by scan, in a figure per host and a table.
`python -m d2lio.what_breaks --scene tunnel_cabinets --out DIR`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from d2lio.bare_tunnel import WORLD_GRAVITY
from d2lio.datasets import ImuBlock, Source, open_source
from d2lio.datasets.events import NS_PER_S, Float64, Int64
from d2lio.errors import DataError
from d2lio.hosts import TITLES
from d2lio.metrics import Trajectory, read_tum
from d2lio.metrics.tum import interpolate
from d2lio.output import replace_file
from d2lio.report import weak_axis
from d2lio.seeds import MAX_GAP_S, REJECTION, built_hosts, in_map, scans, trajectory_of
from d2lio.simulator import Seeds, simulate
from d2lio.simulator import imu as imu_model
from d2lio.simulator.pipeline import EPOCH_NS, TRUTH_FILE, build_world
from d2lio.simulator.trajectory import STANDSTILL
from d2lio.simulator.trajectory import Trajectory as Motion

SCENES = {"tunnel_cabinets": "tunnel with cabinets", "tunnel": "bare tunnel"}  # with an axis
SMOOTHING_S = 1.0  # of the IMU's true error, whose white part is no bias


@dataclass(frozen=True, slots=True)
class Method:
    """One curve: the method for weak directions and its parameters."""

    title: str
    name: str
    params: Mapping[str, str] = field(default_factory=dict)


METHODS = (
    Method("none", "none"),
    Method("paper, w = 30", "paper", {"degeneracy.w": "30"}),
    Method("paper, literal, w = 30", "paper", {"degeneracy.w": "30", "degeneracy.form": "paper"}),
    Method("paper, w = 3000", "paper", {"degeneracy.w": "3000"}),
    Method("remap", "remap"),
    Method("tsvd", "tsvd"),
    Method("xicp", "xicp"),
    Method("noise_aware", "noise_aware"),
)


@dataclass(frozen=True, slots=True)
class Along:
    """What a run believed along the axis, at the ends of its scans; each float64 [N].

    Attributes:
        seconds: from the start of the recording.
        error: of the position, the first pose aligned, m.
        weakest: smallest eigenvalue of the translation, points; NaN where nothing was matched.
        velocity: error, m/s.
        bias: of the accelerometer, m/s^2, as it acts: what the estimated bias, gravity and attitude
            take from the measured force along the axis. A tilt of b / g does what a bias b does,
            and a filter that began at rest cannot tell them apart.
        bias_true: the accelerometer's error, m/s^2.
        correction: position after the match minus the predicted one, m; NaN likewise.
    """

    seconds: Float64
    error: Float64
    weakest: Float64
    velocity: Float64
    bias: Float64
    bias_true: Float64
    correction: Float64


class Summary(NamedTuple):
    """Of one run along the axis, from the first motion on.

    Attributes:
        end: error of the last position, m.
        velocity: largest error, m/s.
        bias: largest error, m/s^2.
        correction: root mean square, m.
        weakest: median of the smallest eigenvalue, points.
    """

    end: float
    velocity: float
    bias: float
    correction: float
    weakest: float


def smoothed(values: Float64, width: int) -> Float64:
    """Running mean over `width` rows of [N, K], over fewer at both ends."""
    if len(values) == 0:
        return values
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    middle = np.arange(len(values))
    low = np.maximum(middle - width // 2, 0)
    high = np.minimum(middle + width // 2 + 1, len(values))
    return (sums[high] - sums[low]) / (high - low)[:, None]


def accelerometer_error(stamps: Int64, accel: Float64, motion: Motion) -> Float64:
    """What a simulated accelerometer adds to the specific force, its noise smoothed away.

    Args:
        stamps: of the samples, int64 [N] ns.
        accel: float64 [N, 3] m/s^2, body.
        motion: what the body did.

    Returns:
        float64 [N, 3] m/s^2, body: bias, walk and scale error.
    """
    _, ideal = imu_model.ideal(motion, (stamps - EPOCH_NS) / NS_PER_S)
    return smoothed(accel - ideal, round(SMOOTHING_S * imu_model.RATE_HZ))


@dataclass(frozen=True, slots=True)
class Drive:
    """A simulated recording and what is true of it.

    Attributes:
        folder: the recording's.
        truth: T_world_imu at the IMU's rate.
        motion: the same, continuous.
        stamps: of the IMU, int64 [N] ns.
        bias: the accelerometer's error, float64 [N, 3] m/s^2, body.
    """

    folder: Path
    truth: Trajectory
    motion: Motion
    stamps: Int64
    bias: Float64

    def source(self) -> Source:
        """The recording, from its beginning."""
        return open_source(self.folder)


def simulated(scene: str, seed: int, duration: float | None, folder: Path) -> Drive:
    """Simulates a sequence into the folder."""
    simulate(scene, folder, seed=seed, duration=duration)
    motion = build_world(scene, Seeds(seed, seed, seed), duration).trajectory
    blocks = [b for b in open_source(folder).reader.raw_events() if isinstance(b, ImuBlock)]
    stamps = np.concatenate([block.stamps for block in blocks])
    accel = np.concatenate([block.accel for block in blocks])
    bias = accelerometer_error(stamps, accel, motion)
    return Drive(folder, read_tum(folder / TRUTH_FILE), motion, stamps, bias)


def along(results: Sequence[Any], drive: Drive) -> Along:
    """The results of a run as seen along the line from the first to the last true position.

    Raises:
        DataError: no results, no motion, or a truth that does not cover them.
    """
    if not results:
        raise DataError(f"{drive.folder.name}: no poses")
    poses = trajectory_of(results)
    true = in_map(drive.truth, poses)
    world = interpolate(drive.truth, poses.stamps, MAX_GAP_S)
    length = np.linalg.norm(true.positions[-1] - true.positions[0])
    if not length > 0.0:
        raise DataError(f"{drive.folder.name}: nothing moves")
    axis = (true.positions[-1] - true.positions[0]) / length
    rotation, rotation_true = (Rotation.from_quat(p.quaternions) for p in (poses, true))
    to_map = rotation_true[0] * Rotation.from_quat(world.quaternions[0]).inv()
    seconds = (poses.stamps - EPOCH_NS) / NS_PER_S
    of_body = np.column_stack([np.interp(poses.stamps, drive.stamps, b) for b in drive.bias.T])

    _, force = imu_model.ideal(drive.motion, seconds)

    def column(name: str) -> Float64:
        return np.array([getattr(result, name) for result in results])

    believed = rotation.apply(force + of_body - column("accel_bias")) + column("gravity")
    acceleration = rotation_true.apply(force) + to_map.apply(WORLD_GRAVITY)
    bias_true = rotation_true.apply(of_body) @ axis

    return Along(
        seconds=seconds,
        error=(poses.positions - true.positions) @ axis,
        weakest=np.array([result.diagnostics["lambda_t_1"] for result in results], dtype=float),
        velocity=(column("velocity") - to_map.apply(drive.motion.velocity(seconds))) @ axis,
        bias=bias_true - (believed - acceleration) @ axis,
        bias_true=bias_true,
        correction=column("correction") @ axis,
    )


def summarised(run: Along, standstill: float = STANDSTILL) -> Summary:
    """One line of the table; what happens in the first `standstill` s is the start-up's."""
    moving = run.seconds >= standstill
    if not moving.any():
        raise DataError("the recording ends before anything moves")
    return Summary(
        end=float(run.error[-1]),
        velocity=float(np.abs(run.velocity[moving]).max()),
        bias=float(np.abs(run.bias - run.bias_true)[moving].max()),
        correction=float(np.sqrt(np.nanmean(run.correction[moving] ** 2))),
        weakest=float(np.nanmedian(run.weakest[moving])),
    )


def measure(drive: Drive, host: str, methods: Sequence[Method] = METHODS) -> dict[str, Along]:
    """Every method in one host over one recording, by title."""
    return {
        m.title: along(list(scans(drive.source(), host, REJECTION[host], m.name, m.params)), drive)
        for m in methods
    }


def write_summaries(path: Path, found: Mapping[tuple[str, str], Summary]) -> None:
    """The CSV file, in one go; keys are host and title of the method."""
    lines = ["host,method,end_m,velocity_m_s,bias_m_s2,correction_rms_m,lambda_t_median"]
    lines += [
        f'{host},"{title}",{",".join(map(repr, summary))}'
        for (host, title), summary in found.items()
    ]
    replace_file(path, "\n".join(lines) + "\n")


def table(scene: str, seed: int, found: Mapping[tuple[str, str], Summary]) -> Table:
    """One line per host and method: the columns of Summary."""
    made = Table(title=f"{scene}, seed {seed}: along the axis, from the first motion on")
    made.add_column("", no_wrap=True)
    for column in ("end, m", "velocity, m/s", "bias, m/s²", "correction, mm", "λ"):
        made.add_column(column, justify="right")
    for (host, title), s in found.items():
        made.add_row(
            f"{host}, {title}", f"{s.end:+.2f}", f"{s.velocity:.2f}", f"{s.bias:.3f}",
            f"{1e3 * s.correction:.1f}", f"{s.weakest:.3g}",
        )  # fmt: skip
    return made


def main(arguments: list[str]) -> int:
    """Prints the table, writes it and the figures; hosts that are not built are left out."""
    parser = argparse.ArgumentParser(prog="python -m d2lio.what_breaks")
    parser.add_argument("--scene", default="tunnel_cabinets", choices=SCENES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hosts", default=",".join(REJECTION), help="separated by commas")
    parser.add_argument("--duration", type=float, help="s; default: the scene's own")
    parser.add_argument("--out", type=Path, help="folder for figures and table")
    options = parser.parse_args(arguments)
    options.seeds = 1
    console = Console() if sys.stdout.isatty() else Console(width=110)
    hosts = built_hosts(parser, options, console)
    found: dict[tuple[str, str], Summary] = {}
    with tempfile.TemporaryDirectory(prefix="d2lio-breaks-") as folder:
        place = Path(folder) / options.scene
        drive = simulated(options.scene, options.seed, options.duration, place) if hosts else None
        for host in hosts if drive is not None else ():
            runs = measure(drive, host)
            found |= {(host, title): summarised(run) for title, run in runs.items()}
            if options.out is not None:
                options.out.mkdir(parents=True, exist_ok=True)
                scene = SCENES[options.scene]
                title = f"{TITLES[host]}, {scene}, seed {options.seed}: along the axis"
                picture = weak_axis.draw(title, runs, STANDSTILL)
                replace_file(options.out / f"degeneracy_{options.scene}_{host}.png", picture)
    if found:
        console.print(table(options.scene, options.seed, found))
        if options.out is not None:
            write_summaries(options.out / f"{options.scene}_{options.seed}.csv", found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
