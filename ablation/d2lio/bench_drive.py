# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Memory over a long drive: `python -m d2lio.bench_drive [--minutes 30] [--host d2lio]`.

A street without end is cast beside the estimator, so nothing grows here but the estimator's own map
and graphs. Odometry that gets lost would prove nothing: its drift is printed as well.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from d2lio.bench_street import MAX_RANGE_M, RINGS, Street
from d2lio.datasets.events import NS_PER_S
from d2lio.hosts import NEED_GTSAM, TITLES, liosam_missing, load_host

MINUTE_NS = 60 * NS_PER_S
MIN_MINUTES = 0.2
GROWTH_GOAL = 0.05  # of the last third of the drive
LOST_SHARE = 0.05  # of a minute's path: an error beyond it means that the odometry did not hold
MB = 2**20
STAMP_0 = 1_700_000_000 * NS_PER_S


@dataclass
class Drive:
    """Samples of a drive, one a simulated minute.

    Attributes:
        minutes: simulated time, min; map_mb: map of the estimator, rss_mb: this process, MB.
        ms: median time per scan of every minute, ms.
        drift: error of every minute's motion as a share of its length: that of the pose at its end,
            seen from the pose at its beginning.
        path_m: driven.
    """

    host: str
    minutes: list[float] = field(default_factory=list)
    map_mb: list[float] = field(default_factory=list)
    rss_mb: list[float] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)
    drift: list[float] = field(default_factory=list)
    scans: int = 0
    path_m: float = 0.0
    wall_s: float = 0.0

    @property
    def held(self) -> bool:
        """Whether the odometry held all the way."""
        return max(self.drift) <= LOST_SHARE

    @property
    def bounded(self) -> bool:
        """Whether memory stopped growing."""
        return max(growth(self.map_mb), growth(self.rss_mb)) < GROWTH_GOAL


def growth(samples: list[float]) -> float:
    """Largest value of the last third over the largest before it, minus one; inf if too few."""
    last = len(samples) // 3
    if last == 0:
        return float("inf")
    return max(samples[-last:]) / max(samples[:-last]) - 1.0


def resident_mb() -> float:
    """Resident memory of this process, MB (Linux)."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MB


def run_drive(name: str, minutes: float, params: dict[str, str] | None = None) -> Drive:
    """Drives `minutes` of simulated time with one thread."""
    street = Street(60.0 * minutes)
    source = {
        "N_SCAN": str(RINGS),
        "preprocess.max_range": str(MAX_RANGE_M),
        "point_filter_num": "1",
    }
    if name not in NEED_GTSAM:
        del source["N_SCAN"]
    host = load_host(name)(source | (params or {}), 1)
    drive, sent, times = Drive(name), 0, []
    last: tuple[int, np.ndarray] | None = None
    mark = last
    begin = time.perf_counter()
    for index in range(street.scans):
        stamp, xyz, dt_ns, ring = street.scan(index)
        until = int(np.searchsorted(street.imu_stamps, stamp + NS_PER_S // 5, side="right"))
        part = slice(sent, until)
        host.add_imu(street.imu_stamps[part] + STAMP_0, street.gyro[part], street.accel[part])
        sent = until
        host.add_scan(STAMP_0 + stamp, xyz, dt_ns, None, ring)
        while (result := host.step()) is not None:
            drive.scans += 1
            times.append(float(result.diagnostics["time_total_ms"]))
            if result.has_pose:
                last = (result.stamp - STAMP_0, result.T_map_imu)
                mark = mark or last
        if stamp // MINUTE_NS > len(drive.minutes) or index == street.scans - 1:
            _sample(drive, host, stamp, times)
            _score(drive, street, mark, last)
            mark, times = last, []
    drive.wall_s = time.perf_counter() - begin
    return drive


def _sample(drive: Drive, host: Any, stamp: int, times: list[float]) -> None:
    drive.minutes.append(stamp / MINUTE_NS)
    drive.map_mb.append(host.map_bytes / MB)
    drive.rss_mb.append(resident_mb())
    drive.ms.append(float(np.median(times)) if times else float("nan"))


def _score(
    drive: Drive,
    street: Street,
    begin: tuple[int, np.ndarray] | None,
    end: tuple[int, np.ndarray] | None,
) -> None:
    """Adds a minute's drift; the poses are (ns since the start, T_map_imu)."""
    if begin is None or end is None:
        drive.drift.append(float("inf"))
        return
    position, rotation = street.trajectory.pose(np.array([begin[0], end[0]]) * 1e-9)
    true = rotation[0].T @ (position[1] - position[0])
    estimated = begin[1][:3, :3].T @ (end[1][:3, 3] - begin[1][:3, 3])
    path = float(np.linalg.norm(true))
    drive.drift.append(float(np.linalg.norm(estimated - true)) / max(path, 1.0))
    drive.path_m += path


def table(drive: Drive) -> Table:
    """Memory by simulated time: about ten rows."""
    made = Table(
        title=f"{TITLES[drive.host]}: memory over {drive.minutes[-1]:.0f} simulated minutes"
    )
    for name in ("minute", "map MB", "process MB", "median ms/scan", "drift %"):
        made.add_column(name, justify="right")
    step = max(1, len(drive.minutes) // 10)
    rows = sorted({*range(0, len(drive.minutes), step), len(drive.minutes) - 1})
    for i in rows:
        made.add_row(
            f"{drive.minutes[i]:.0f}",
            f"{drive.map_mb[i]:.1f}",
            f"{drive.rss_mb[i]:.0f}",
            f"{drive.ms[i]:.1f}",
            f"{100 * drive.drift[i]:.2f}",
        )
    return made


def verdict(drive: Drive) -> str:
    """One line: start, end and peak of both figures, and the word."""
    if not drive.held:
        return f"memory: FAIL, the odometry got lost: {_drift(drive)}"
    word = "PASS, bounded" if drive.bounded else "FAIL, growing"
    return (
        f"memory: {word}: map {_span(drive.map_mb)}; process {_span(drive.rss_mb)}; "
        f"goal: last third below {100 * GROWTH_GOAL:+.0f} %; "
        f"{drive.path_m / 1000:.1f} km driven, {_drift(drive)}"
    )


def _drift(drive: Drive) -> str:
    return f"drift up to {100 * max(drive.drift):.2f} % of a minute's path"


def _span(samples: list[float]) -> str:
    more = f"last third {100 * growth(samples):+.1f} %"
    return f"{samples[0]:.0f} -> {samples[-1]:.0f} MB (peak {max(samples):.0f}, {more})"


def main(arguments: list[str]) -> int:
    """Prints the table and the verdict; a host that is not built is said and left out."""
    parser = argparse.ArgumentParser(prog="python -m d2lio.bench_drive")
    parser.add_argument("--minutes", type=float, default=30.0, help="simulated time")
    parser.add_argument("--host", choices=sorted(TITLES), default="d2lio")
    parser.add_argument("--out", type=Path, help="JSON file for the samples")
    options = parser.parse_args(arguments)
    if not options.minutes >= MIN_MINUTES:
        parser.error(f"--minutes must be at least {MIN_MINUTES:g}")
    console = Console() if sys.stdout.isatty() else Console(width=110)
    why = liosam_missing()
    if options.host in NEED_GTSAM and why is not None:
        console.print(f"memory over a drive: left out, {why}", highlight=False)
        return 0
    drive = run_drive(options.host, options.minutes)
    if options.out is not None:
        options.out.write_text(json.dumps(asdict(drive), indent=2) + "\n", encoding="utf-8")
    console.print(table(drive))
    console.print(verdict(drive), highlight=False)
    rate = 60.0 * drive.minutes[-1] / drive.wall_s
    console.print(f"took {drive.wall_s:.0f} s, {rate:.0f} times real time", highlight=False)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
