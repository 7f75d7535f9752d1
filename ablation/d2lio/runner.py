# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Drives one estimator over one source and writes what came out."""

from __future__ import annotations

import hashlib
import math
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from d2lio import __version__
from d2lio.datasets import ImuBlock, Source, timed_events
from d2lio.datasets.events import NS_PER_S, Event
from d2lio.errors import ConfigError
from d2lio.hosts import Host, ScanResult, load_host
from d2lio.output import OutputDir, ResultWriter
from d2lio.record import RunRecord, ScanCounts, StageTime
from d2lio.source_params import all_params

DIVERGED_M = 1e5  # no sequence of ours leads that far from its start

Progress = Callable[[int, int | None], None]


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What `d2lio run` was asked for.

    Attributes:
        host: name in `HOSTS`.
        rejection, degeneracy: mode and method; None leaves the host's default.
        params: further host parameters as texts, these win.
        threads: of the host.
        max_scans: stop after this many scans were fed; None reads all.
        start_offset_s: begin so much after the first message; what comes before is left out.
        command: recorded in run.json.
    """

    host: str = "fastlio"
    rejection: str | None = None
    degeneracy: str | None = None
    params: dict[str, str] = field(default_factory=dict)
    threads: int = 1
    max_scans: int | None = None
    start_offset_s: float = 0.0
    command: list[str] = field(default_factory=list)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a run; what was done so far lies in `partial`."""

    def __init__(self, partial: Path) -> None:
        self.partial = partial
        super().__init__(f"interrupted; the results so far are in {partial}")


@dataclass(slots=True)
class _Tally:
    """Running figures of one run."""

    health: Counter[str] = field(default_factory=Counter)
    status: Counter[str] = field(default_factory=Counter)
    without_pose: Counter[str] = field(default_factory=Counter)
    times: dict[str, list[float]] = field(default_factory=dict)
    offered: int = 0
    accepted: int = 0
    poses: int = 0
    path_m: float = 0.0
    first_stamp: int | None = None
    last_stamp: int = 0
    last_position: np.ndarray | None = None
    scans_fed: int = 0
    scans_before_start: int = 0
    start_stamp: int | None = None
    read_s: float = 0.0
    host_s: float = 0.0
    diverged: str = ""

    def add(self, result: ScanResult) -> bool:
        """Counts a result; whether it carries a pose to write."""
        self.health[result.health] += 1
        self.status[result.status] += 1
        row = result.diagnostics
        self.offered += int(row.get("offered", 0))
        self.accepted += int(row.get("accepted", 0))
        if not result.has_pose:
            self.without_pose[result.status] += 1
            return False
        # LIO-SAM skips every other scan in no time: that is no time per scan.
        for key, value in row.items():
            if key.startswith("time_") and key.endswith("_ms"):
                self.times.setdefault(key[5:-3], []).append(float(value))
        self._follow(result)
        return True

    def _follow(self, result: ScanResult) -> None:
        position = np.array(result.T_map_imu[:3, 3], np.float64)
        self.poses += 1
        self.first_stamp = result.stamp if self.first_stamp is None else self.first_stamp
        self.last_stamp = result.stamp
        if not np.isfinite(result.T_map_imu).all():
            self.diverged = self.diverged or f"pose {self.poses} is not finite"
            return
        if np.linalg.norm(position) > DIVERGED_M:
            self.diverged = self.diverged or f"pose {self.poses} lies {DIVERGED_M:g} m away"
        if self.last_position is not None:
            self.path_m += float(np.linalg.norm(position - self.last_position))
        self.last_position = position


def _begin_later(events: Iterator[Event], offset_s: float, tally: _Tally) -> Iterator[Event]:
    """The events from `offset_s` after the first one on; notes where that is."""
    for event in events:
        first = int(event.stamps[0]) if isinstance(event, ImuBlock) else event.stamp
        if tally.start_stamp is None:
            tally.start_stamp = first + round(offset_s * NS_PER_S)
        if first >= tally.start_stamp:
            yield event
        elif not isinstance(event, ImuBlock):
            tally.scans_before_start += 1
        elif event.stamps[-1] >= tally.start_stamp:
            yield _samples_from(event, tally.start_stamp)


def _samples_from(block: ImuBlock, start: int) -> ImuBlock:
    keep = block.stamps >= start
    orientation = None if block.orientation is None else block.orientation[keep]
    return ImuBlock(block.stamps[keep], block.gyro[keep], block.accel[keep], orientation)


def _timed_next(events: Iterator[Event], tally: _Tally) -> Event | None:
    start = time.perf_counter()
    event = next(events, None)
    tally.read_s += time.perf_counter() - start
    return event


def _drain(host: Host, writer: ResultWriter, tally: _Tally, report: Callable[[], None]) -> None:
    while True:
        start = time.perf_counter()
        result = host.step()
        tally.host_s += time.perf_counter() - start
        if result is None:
            return
        if tally.add(result):
            writer.add(result.stamp, result.T_map_imu, result.diagnostics)
        else:
            writer.add_row(result.diagnostics)
        report()


def _feed(
    host: Host,
    source: Source,
    writer: ResultWriter,
    tally: _Tally,
    options: RunOptions,
    progress: Progress | None,
) -> None:
    total = source.reader.scan_total
    if options.max_scans is not None:
        total = options.max_scans if total is None else min(total, options.max_scans)

    def report() -> None:
        if progress is not None:
            progress(sum(tally.health.values()), total)

    events = timed_events(source.reader, log_times=source.log_times)
    if options.start_offset_s > 0.0:
        events = _begin_later(events, options.start_offset_s, tally)
    while (event := _timed_next(events, tally)) is not None:
        if isinstance(event, ImuBlock):
            host.add_imu(event.stamps, event.gyro, event.accel, event.orientation)
        elif options.max_scans is not None and tally.scans_fed >= options.max_scans:
            break
        else:
            tally.scans_fed += 1
            host.add_scan(event.stamp, event.xyz, event.dt_ns, event.intensity, event.ring)
        _drain(host, writer, tally, report)
    host.finish()
    _drain(host, writer, tally, report)


def run(
    source: Source, options: RunOptions, out: Path, progress: Progress | None = None
) -> RunRecord:
    """Runs an estimator over a source and writes trajectory, diagnostics and run.json.

    Args:
        source: opened data set.
        options: estimator and parameters.
        out: directory to appear when the run is complete.
        progress: called with (scans done, scans expected or None).

    Raises:
        ConfigError: refused parameter (key, value, allowed range), before anything is written.
        DataError: unreadable input or unwritable output.
        Interrupted: Ctrl-C; OUT.partial holds what was done, marked as interrupted.
    """
    if options.threads < 1:
        raise ConfigError("threads", options.threads, ">= 1")
    if not 0.0 <= options.start_offset_s < math.inf:
        raise ConfigError("start-offset", options.start_offset_s, ">= 0 (s)")
    make_host = load_host(options.host)
    params = all_params(
        source.config, options.host, options.rejection, options.degeneracy, options.params
    )
    host = make_host(params, options.threads)
    tally = _Tally()
    begin = time.perf_counter()
    with OutputDir(out) as directory:
        writer = ResultWriter(directory.path)
        interrupted = False
        try:
            _feed(host, source, writer, tally, options, progress)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            writer.close()
        record = _record(source, options, params, host, tally)
        record.wall_s = time.perf_counter() - begin
        if interrupted:
            record.status, record.reason = "interrupted", "stopped by the user"
        record.save(directory.path)
        if interrupted:
            raise Interrupted(directory.keep_partial())
        directory.commit()
    return record


def _record(
    source: Source, options: RunOptions, params: dict[str, str], host: Host, tally: _Tally
) -> RunRecord:
    notes = source.reader.notes
    inputs = source.reader.inputs
    first = tally.last_stamp if tally.first_stamp is None else tally.first_stamp
    record = RunRecord(
        status="complete",
        version=__version__,
        command=options.command,
        sequence=source.name,
        host=options.host,
        params=_effective(options.host, params),
        threads=options.threads,
        start_offset_s=options.start_offset_s,
        start_stamp_ns=tally.start_stamp,
        scans=_scan_counts(notes.counts, tally, host.counts()),
        imu_read=notes.counts.get("imu_read", 0),
        health=dict(tally.health),
        scan_status=dict(tally.status),
        host_counts=host.counts(),
        accepted_share=tally.accepted / tally.offered if tally.offered else None,
        time_ms={stage: _stage(values) for stage, values in tally.times.items()},
        read_s=tally.read_s,
        host_s=tally.host_s,
        peak_memory_mb=peak_memory_mb(),
        path_m=tally.path_m,
        duration_s=(tally.last_stamp - first) * 1e-9,
        ground_truth=str(source.ground_truth) if source.ground_truth else None,
        notes=notes.messages,
        inputs=inputs,
        inputs_hash=hashlib.sha256("\n".join(inputs).encode()).hexdigest(),
    )
    if tally.poses == 0:
        record.status, record.reason = "failed", "no scan gave a pose"
    elif tally.diverged:
        record.status, record.reason = "diverged", tally.diverged
    return record


def _effective(host: str, params: dict[str, str]) -> dict[str, str]:
    """Every parameter of the host with the value it ran with."""
    values = {entry["key"]: str(entry["default"]) for entry in load_host(host).describe()}
    return values | params


def _scan_counts(reader: dict[str, int], tally: _Tally, host: dict[str, int]) -> ScanCounts:
    taken = tally.scans_fed + tally.scans_before_start
    read = max(reader.get("scans_read", 0), taken)
    processed = tally.poses
    dropped = {k: v for k, v in reader.items() if k.startswith(("scans_empty", "scans_bad"))}
    unread = read - taken - sum(dropped.values())
    if tally.scans_before_start > 0:
        dropped["before_start"] = tally.scans_before_start
    if unread > 0:
        dropped["beyond_max_scans"] = unread
    dropped |= {f"no_pose_{status}": n for status, n in tally.without_pose.items()}
    rest = tally.scans_fed - sum(tally.health.values())
    if rest > 0:  # the host's own counts tell why
        dropped["before_processing"] = rest
    return ScanCounts(read=read, processed=processed, dropped=dropped)


def _stage(values: list[float]) -> StageTime:
    array = np.asarray(values)
    return StageTime(
        mean=float(array.mean()),
        median=float(np.median(array)),
        p95=float(np.percentile(array, 95)),
        max=float(array.max()),
    )


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)
