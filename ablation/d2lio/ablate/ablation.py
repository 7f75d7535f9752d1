# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`d2lio ablate` as a function: plan, carry out, collect, report."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from d2lio.ablate import results
from d2lio.ablate.cell import RUNS, Outcome, Scores, finished, result_row, timing_row
from d2lio.ablate.execute import SCRATCH
from d2lio.ablate.plan import Plan, make_plan
from d2lio.ablate.results import Results
from d2lio.ablate.schedule import LocalPool, Pool, Tally, Watcher, carry_out, remove_sequence
from d2lio.ablate.sequences import SEQUENCES
from d2lio.ablate.suite import Suite
from d2lio.errors import DataError

LOCK_FILE = ".lock"
OWN_ENTRIES = {RUNS, SEQUENCES, LOCK_FILE, results.SUITE_FILE}


@dataclass(frozen=True, slots=True)
class AblateOptions:
    """How a suite is run.

    Attributes:
        jobs: runs at once on this machine.
        threads: of each estimator.
        data: directory of recordings that take the place of simulated sequences.
        imports: directories of TUM files, by the name that variants import.
        scheduler: address of a Dask scheduler instead of this machine.
        keep_sequences: leave simulated sequences on the disk (100 to 300 MB each).
        fresh: run again what is done already.
    """

    jobs: int = 1
    threads: int = 1
    data: Path | None = None
    imports: dict[str, Path] = field(default_factory=dict)
    scheduler: str | None = None
    keep_sequences: bool = False
    fresh: bool = False


@dataclass(frozen=True, slots=True)
class Ablation:
    """What came out; `problems` are reasons by the directory of cells without a result."""

    results: Results
    problems: dict[str, str]


def ablate(suite: Suite, out: Path, options: AblateOptions, watcher: Watcher) -> Ablation:
    """Runs what is not done yet and writes suite.yaml and the result tables.

    Stopped at any moment and started again, it ends with the same tables.

    Raises:
        ConfigError: nothing of the suite can run; DataError: unusable directory or cluster.
        KeyboardInterrupt: Ctrl-C; what is done stays done.
    """

    def plan() -> Plan:
        return make_plan(
            suite, out, data=options.data, imports=options.imports, threads=options.threads
        )

    return carry_out_plan(suite.name, plan, out, options, watcher)


def carry_out_plan(
    name: str, planner: Callable[[], Plan], out: Path, options: AblateOptions, watcher: Watcher
) -> Ablation:
    """The same for a plan made otherwise; `planner` is called when the directory is ours.

    Args:
        name: of the suite.

    Raises:
        See `ablate`.
    """
    _prepare(out, name)
    with _locked(out):
        _sweep(out)
        plan = planner()
        done = {} if options.fresh else _done(plan, out)
        if options.fresh:
            _forget(plan, out)
        if len(done) < len(plan.cells):
            results.discard(out)  # never tables of another suite beside suite.yaml
        results.write_text(out / results.SUITE_FILE, plan.suite.to_yaml())
        tally = _carry_out(plan, done, out, options, watcher)
        return Ablation(_collect(plan, tally, out), tally.problems)


def _carry_out(
    plan: Plan, done: dict[str, Outcome], out: Path, options: AblateOptions, watcher: Watcher
) -> Tally:
    if len(done) == len(plan.cells):
        for group in plan.groups if not options.keep_sequences else []:
            remove_sequence(group)
        return Tally(done)
    pool = _pool(out, options)
    try:
        return carry_out(
            plan.groups, done, out, pool, watcher, keep_sequences=options.keep_sequences
        )
    finally:
        pool.close()


def _pool(out: Path, options: AblateOptions) -> Pool:
    if options.scheduler is None:
        return LocalPool(options.jobs)
    from d2lio.ablate.cluster import DaskPool

    return DaskPool(options.scheduler, out)


def _prepare(out: Path, name: str) -> None:
    """Makes the directory; one that holds something else is refused."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        entries = {entry.name for entry in out.iterdir()}
    except OSError as err:
        raise DataError(f"{out}: cannot be written: {err.strerror}") from None
    if results.SUITE_FILE in entries:
        former = Suite.load(out / results.SUITE_FILE).name
        if former != name:
            raise DataError(f"{out}: holds the suite {former}; choose another --out")
    elif entries - OWN_ENTRIES:
        raise DataError(f"{out}: exists and holds no ablation; choose another --out")


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """Keeps a second ablation out of the directory."""
    try:
        lock = os.open(out / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as err:
        raise DataError(f"{out}: cannot be written: {err.strerror}") from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DataError(f"{out}: another ablation is at work there") from None
        except OSError:
            pass  # a file system without locks
        yield
    finally:
        os.close(lock)


def _sweep(out: Path) -> None:
    """Removes what an interrupted ablation left half-done."""
    for pattern in (f"{RUNS}/*/*/{SCRATCH}*", f"{SEQUENCES}/{SCRATCH}*", f"{SCRATCH}*.tmp"):
        for leftover in out.glob(pattern):
            if leftover.is_dir():
                shutil.rmtree(leftover, ignore_errors=True)
            else:
                leftover.unlink(missing_ok=True)


def _done(plan: Plan, out: Path) -> dict[str, Outcome]:
    found = ((cell.directory, finished(out, cell)) for cell in plan.cells)
    return {directory: outcome for directory, outcome in found if outcome is not None}


def _forget(plan: Plan, out: Path) -> None:
    for cell in plan.cells:
        shutil.rmtree(out / cell.directory, ignore_errors=True)


def _collect(plan: Plan, tally: Tally, out: Path) -> Results:
    rows, timings = [], []
    for spec in plan.cells:
        outcome = tally.outcomes.get(spec.directory)
        if outcome is None:
            reason = f"not carried out: {tally.problems.get(spec.directory, 'stopped')}"
            rows.append(result_row(plan.suite, spec, Scores(status="fail", reason=reason)))
        else:
            rows.append(result_row(plan.suite, spec, outcome.scores))
            timings.append(timing_row(spec, outcome.costs))
    results.save(out, rows, timings)
    with suppress(OSError):
        (out / SEQUENCES).rmdir()  # where nothing is left in it
    return Results(plan.suite, rows, {row.key: row for row in timings}, out, plan.notes)
