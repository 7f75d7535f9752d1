# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Carries out the cells of a plan, on this machine or on a Dask cluster.

One loop for both: it hands out a job when a slot is free, so that sequences are made shortly before
their cells run and removed after the last of them, and few lie on the disk at once.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from d2lio.ablate import execute
from d2lio.ablate.cell import CellSpec, Outcome
from d2lio.ablate.plan import Group

TICK_S = 0.5  # the display is brought up to date this often


class Pool(Protocol):
    """Where jobs run."""

    @property
    def slots(self) -> int:
        """How many jobs can run at once, now."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Starts a job."""

    def close(self) -> None:
        """Ends what still runs; may be called twice."""


class LocalPool:
    """Threads of this process, each with one process for the job at hand."""

    def __init__(self, jobs: int) -> None:
        self._stop = threading.Event()
        self._executor = ThreadPoolExecutor(jobs)
        self._slots = jobs

    @property
    def slots(self) -> int:
        """Number of jobs at once."""
        return self._slots

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Starts `function(*arguments, stop)` in a thread."""
        return self._executor.submit(function, *arguments, self._stop)

    def close(self) -> None:
        """Ends all jobs and their processes."""
        self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)
        execute.close_slots()


class Watcher(Protocol):
    """Who is told how it goes on."""

    def begin(self, groups: list[Group], done: Mapping[str, Outcome], slots: int) -> None:
        """The groups with all their cells, and those that were done before by directory."""

    def started(self, label: str) -> None:
        """A job runs."""

    def made(self, label: str, seconds: float) -> None:
        """A sequence is there."""

    def finished(self, spec: CellSpec, outcome: Outcome) -> None:
        """A cell is done."""

    def problem(self, label: str, reason: str) -> None:
        """A job could not be carried out."""

    def tick(self, slots: int) -> None:
        """Nothing happened for a while."""


@dataclass(slots=True)
class _Progress:
    """A group on its way: waiting cells, and how many are not done yet."""

    group: Group
    waiting: list[CellSpec]
    left: int
    ready: bool


@dataclass(frozen=True, slots=True)
class _Job:
    part: _Progress
    cell: CellSpec | None  # None: its sequence is being made

    @property
    def label(self) -> str:
        if self.cell is not None:
            return self.cell.label
        return f"simulating {self.part.group.origin.path.name}"


@dataclass(slots=True)
class Tally:
    """What came out.

    Attributes:
        outcomes: by the cell's directory.
        problems: reasons by the directory of each cell that could not be carried out.
    """

    outcomes: dict[str, Outcome] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)


def carry_out(
    groups: list[Group],
    done: Mapping[str, Outcome],
    out: Path,
    pool: Pool,
    watcher: Watcher,
    *,
    keep_sequences: bool = False,
) -> Tally:
    """Carries out every cell that is not in `done`.

    A cell that fails is a result; one that cannot be carried out (disk full, its sequence cannot be
    made, workers lost) is noted as a problem and the others go on.
    """
    loop = _Loop(groups, done, out, pool, watcher, keep_sequences)
    watcher.begin(groups, done, pool.slots)
    loop.run()
    return loop.tally


def remove_sequence(group: Group) -> None:
    """Takes a simulated sequence off the disk."""
    if group.origin.simulation is not None:
        shutil.rmtree(group.origin.path, ignore_errors=True)


class _Loop:
    def __init__(
        self,
        groups: list[Group],
        done: Mapping[str, Outcome],
        out: Path,
        pool: Pool,
        watcher: Watcher,
        keep: bool,
    ) -> None:
        self.tally = Tally(dict(done))
        self._out, self._pool, self._watcher, self._keep = out, pool, watcher, keep
        self._running: dict[Future[Any], _Job] = {}
        self._live: list[_Progress] = []
        self._upcoming = []
        for group in groups:
            cells = [cell for cell in group.cells if cell.directory not in done]
            if cells:
                ready = group.origin.simulation is None
                self._upcoming.append(_Progress(group, cells, len(cells), ready))
            else:
                self._remove(group)

    def run(self) -> None:
        while True:
            self._fill()
            if not self._running:
                return
            finished, _ = wait(self._running, timeout=TICK_S, return_when=FIRST_COMPLETED)
            for future in finished:
                self._take(future, self._running.pop(future))
            self._watcher.tick(self._pool.slots)

    def _fill(self) -> None:
        """Hands out jobs while there are slots; without any, one waits for the first."""
        slots = max(1, self._pool.slots)
        while len(self._running) < slots:
            job = self._next(slots)
            if job is None:
                return
            self._watcher.started(job.label)
            self._running[self._submit(job)] = job

    def _next(self, slots: int) -> _Job | None:
        # A new sequence as soon as the cells at hand would not keep all slots busy.
        if self._upcoming and sum(len(part.waiting) for part in self._live) < slots:
            part = self._upcoming.pop(0)
            self._live.append(part)
            if not part.ready:
                return _Job(part, None)
        for part in self._live:
            if part.ready and part.waiting:
                return _Job(part, part.waiting.pop(0))
        return None

    def _submit(self, job: _Job) -> Future[Any]:
        if job.cell is not None:
            data = job.cell.model_dump(mode="json")
            return self._pool.submit(execute.execute, data, str(self._out))
        origin = job.part.group.origin
        return self._pool.submit(execute.make_sequence, origin.simulation, str(origin.path))

    def _take(self, future: Future[Any], job: _Job) -> None:
        try:
            value = future.result()
        except (Exception, CancelledError) as err:
            self._failed(job, str(err) or type(err).__name__)
            return
        if job.cell is None:
            job.part.ready = True
            self._watcher.made(job.label, float(value["seconds"]))
            return
        outcome = Outcome.model_validate(value)
        self.tally.outcomes[job.cell.directory] = outcome
        self._watcher.finished(job.cell, outcome)
        self._one_less(job.part)

    def _failed(self, job: _Job, reason: str) -> None:
        self._watcher.problem(job.label, reason)
        part = job.part
        cells = [job.cell] if job.cell is not None else part.waiting
        for cell in cells:
            self.tally.problems[cell.directory] = reason
        if job.cell is None:
            part.waiting = []
            self._live.remove(part)
        else:
            self._one_less(part)

    def _one_less(self, part: _Progress) -> None:
        part.left -= 1
        if part.left == 0:
            self._live.remove(part)
            self._remove(part.group)

    def _remove(self, group: Group) -> None:
        if not self._keep:
            remove_sequence(group)
