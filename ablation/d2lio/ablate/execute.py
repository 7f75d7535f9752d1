# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs jobs in processes of their own, with limits, and puts what they leave into place."""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from d2lio.ablate.cell import CELL_FILE, LOG_FILE, CellSpec, Outcome, Scores, finished
from d2lio.ablate.server import ERROR_FILE, end_group, load_plugins
from d2lio.ablate.suite import Limits
from d2lio.errors import DataError
from d2lio.hosts import load_host
from d2lio.peers import PEERS, environments

TICK_S = 0.1  # between looks at the clock and the wish to stop
MEMORY_TICK_S = 0.5  # between looks at memory, which cost milliseconds
SCRATCH = "."  # names of unfinished directories begin with it
SIMULATION_LIMITS = Limits(time_s=3600.0, memory_mb=8000.0)
OUTSIDE = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)  # someone ended it: no result of ours
DISK_FULL = ("No space left on device", "disk is full", "Disk quota exceeded")
REASON_LENGTH = 300


class StoppedError(Exception):
    """The job was ended because everything stops."""


class NotCarriedOutError(Exception):
    """Nothing is known about the cell: the machine or the set-up is at fault, not the run."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a job ended: exit code (negative: signal), why we ended it if we did, what it took."""

    code: int
    reason: str
    seconds: float
    peak_mb: float


class Slot:
    """A server process (see `server`) and the job that it runs."""

    def __init__(self, threads: int) -> None:
        names = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "TBB")
        limits = {f"{name}_NUM_THREADS": str(threads) for name in names}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "d2lio.ablate.server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env={**os.environ, **limits},
            start_new_session=True,  # Ctrl-C is ours to handle
        )
        self._answers = b""

    @property
    def alive(self) -> bool:
        """Whether it can take a job."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends the server and its job."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
        self._process.wait()

    def run(self, request: dict[str, Any], limits: Limits, stop: threading.Event | None) -> Ended:
        """Runs a job to its end, or ends it at a limit.

        Raises:
            StoppedError: `stop` was set; NotCarriedOutError: the server is gone.
        """
        begin = time.monotonic()
        watch = _Watch(begin, limits)
        try:
            code = self._follow(request, watch, stop)
        except BaseException as err:
            self.close()  # ends the job, too
            if isinstance(err, OSError | EOFError):
                text = f"the process that starts runs is gone ({err})"
                raise NotCarriedOutError(text) from None
            raise
        return Ended(code, watch.reason, time.monotonic() - begin, watch.peak_mb)

    def _follow(self, request: dict[str, Any], watch: _Watch, stop: threading.Event | None) -> int:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request).encode() + b"\n")
        pid = 0
        while True:
            word, number = self._answer(TICK_S)
            if word == "ended":
                return number
            if word == "started":
                pid = number
            if stop is not None and stop.is_set():
                raise StoppedError
            if pid and watch.exceeded(pid):
                end_group(pid)

    def _answer(self, timeout_s: float) -> tuple[str, int]:
        assert self._process.stdout is not None
        if b"\n" not in self._answers:
            ready, _, _ = select.select([self._process.stdout], [], [], timeout_s)
            if not ready:
                return "", 0
            chunk = os.read(self._process.stdout.fileno(), 4096)
            if not chunk:
                raise EOFError("end of its answers")
            self._answers += chunk
        line, found, rest = self._answers.partition(b"\n")
        if not found:
            return "", 0
        self._answers = rest
        word, number = line.split()
        return word.decode(), int(number)


class _Watch:
    """Time and memory of a job with all its processes."""

    def __init__(self, begin: float, limits: Limits) -> None:
        self._begin, self._limits = begin, limits
        self._looked = -MEMORY_TICK_S
        self.peak_mb = 0.0
        self.reason = ""

    def exceeded(self, pid: int) -> bool:
        """Looks once; `reason` says what went beyond its limit."""
        passed = time.monotonic() - self._begin
        if passed - self._looked > MEMORY_TICK_S:
            self._looked = passed
            self.peak_mb = max(self.peak_mb, _memory_mb(pid))
        if not self.reason and passed > self._limits.time_s:
            self.reason = f"took longer than {self._limits.time_s:g} s"
        if not self.reason and self.peak_mb > self._limits.memory_mb:
            self.reason = f"used more than {self._limits.memory_mb:g} MB of memory"
        return bool(self.reason)


def _memory_mb(pid: int) -> float:
    """Resident size of a process and all below it, MB."""
    total = 0
    with suppress(psutil.Error):
        process = psutil.Process(pid)
        for each in (process, *process.children(recursive=True)):
            with suppress(psutil.Error):
                total += each.memory_info().rss
    return total / 2**20


_slots: dict[tuple[int, int], Slot] = {}  # by thread and its jobs' threads
_lock = threading.Lock()


def _slot(threads: int) -> Slot:
    """The server of the calling thread."""
    key = (threading.get_ident(), threads)
    with _lock:
        slot = _slots.get(key)
    if slot is None or not slot.alive:
        if slot is not None:
            slot.close()
        slot = Slot(threads)
        with _lock:
            _slots[key] = slot
    return slot


def close_slots() -> None:
    """Ends all servers of this process and their jobs."""
    with _lock:
        slots = list(_slots.values())
        _slots.clear()
    for slot in slots:
        slot.close()


def host_missing(name: str) -> str | None:
    """Why a host or peer cannot be run on this machine; None where it can.

    Raises:
        ConfigError: no such host.
    """
    load_plugins()
    try:
        load_host(name)
        if name in PEERS:
            environments.interpreter(PEERS[name])
    except DataError as err:
        return str(err)
    return None


def execute(
    spec_data: dict[str, Any], out: str, stop: threading.Event | None = None
) -> dict[str, Any]:
    """Carries a cell out and puts its files into place; a cell that is done stays as it is.

    Arguments and result are plain data, so that both can travel to another machine.

    Raises:
        StoppedError: see `Slot.run`; NotCarriedOutError: no result, the cell must run again.
    """
    spec = CellSpec.model_validate(spec_data)
    target = Path(out) / spec.directory
    if (done := finished(Path(out), spec)) is not None:
        return done.model_dump()
    why = None if spec.host is None else host_missing(spec.host)
    if not Path(spec.source).exists():
        why = f"{spec.source}: not there"
    if why is not None:  # on this machine
        raise NotCarriedOutError(why)
    with _working_directory(target) as work:
        request = {"job": "cell", "spec": spec.model_dump(mode="json"), "work": str(work)}
        ended = _slot(spec.threads).run({**request, "log": LOG_FILE}, spec.limits, stop)
        outcome = _outcome(spec, work, ended)
        _put_into_place(work, target, outcome)
    return outcome.model_dump()


def make_sequence(
    request: dict[str, Any], target: str, stop: threading.Event | None = None
) -> dict[str, Any]:
    """Simulates a sequence into `target` unless it is there.

    Raises:
        StoppedError: see `Slot.run`; NotCarriedOutError: it failed, with its reason.
    """
    place = Path(target)
    if place.is_dir():  # it appears in one step
        return {"seconds": 0.0}
    with _working_directory(place) as work:
        spec = {**request, "out": target}
        job = {"job": "simulate", "spec": spec, "work": str(work), "log": LOG_FILE}
        ended = _slot(1).run(job, SIMULATION_LIMITS, stop)
        if ended.code != 0 or ended.reason:
            raise NotCarriedOutError(f"simulation: {ended.reason or _reason(ended.code, work)}")
    return {"seconds": ended.seconds}


class _working_directory:  # noqa: N801, reads as a function
    """A directory beside `target` that is gone afterwards."""

    def __init__(self, target: Path) -> None:
        self._target = target

    def __enter__(self) -> Path:
        try:
            self._target.parent.mkdir(parents=True, exist_ok=True)
            name = f"{SCRATCH}{self._target.name}-"
            self._path = Path(tempfile.mkdtemp(prefix=name, dir=self._target.parent))
            self._path.chmod(0o755)
        except OSError as err:
            raise NotCarriedOutError(f"{self._target}: cannot be written: {err.strerror}") from None
        return self._path

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._path, ignore_errors=True)


def _outcome(spec: CellSpec, work: Path, ended: Ended) -> Outcome:
    """What the job said, or a failure with its reason."""
    told = None
    if ended.code == 0 and not ended.reason:
        text = (work / "run" / CELL_FILE).read_text(encoding="utf-8")
        told = Outcome.model_validate_json(text)
    else:
        reason = ended.reason or _reason(ended.code, work)
        if any(text in reason for text in DISK_FULL):
            raise NotCarriedOutError(reason)
        if not ended.reason and -ended.code in OUTSIDE:
            raise NotCarriedOutError(f"ended from outside ({signal.Signals(-ended.code).name})")
        told = Outcome(digest=spec.digest(), scores=Scores(status="fail", reason=reason))
    told.costs.process_s = ended.seconds
    told.costs.peak_memory_mb = max(told.costs.peak_memory_mb or 0.0, ended.peak_mb) or None
    return told


def _reason(code: int, work: Path) -> str:
    if code < 0:
        with suppress(ValueError):
            return f"crashed ({signal.Signals(-code).name})"
        return f"crashed (signal {-code})"
    with suppress(OSError, ValueError):
        data = json.loads((work / ERROR_FILE).read_text(encoding="utf-8"))
        # The working directory's name is another one each time.
        return str(data["reason"]).replace(f"{work}/", "")[:REASON_LENGTH]
    lines = (work / LOG_FILE).read_text(errors="replace").splitlines()
    said = [line.strip() for line in lines if line.strip()]
    return f"internal error: {said[-1]}"[:REASON_LENGTH] if said else f"exit code {code}"


def _put_into_place(work: Path, target: Path, outcome: Outcome) -> None:
    """The finished directory appears in one step, cell.json in it."""
    place = work / "run"
    try:
        place.mkdir(exist_ok=True)
        if (work / LOG_FILE).exists():
            os.replace(work / LOG_FILE, place / LOG_FILE)
        text = outcome.model_dump_json(indent=2) + "\n"
        (place / CELL_FILE).write_text(text, encoding="utf-8")
        if target.exists():
            os.replace(target, work / "old")
        os.replace(place, target)
    except OSError as err:
        if (target / CELL_FILE).exists():  # another machine was first, with the same result
            return
        raise NotCarriedOutError(f"{target}: cannot be written: {err.strerror}") from None
