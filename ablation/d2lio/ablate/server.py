# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Forks a process for every run from one that has imported everything already.

Importing costs one to two seconds of processor time, more than some runs take. The server is
single-threaded and runs one job at a time: it reads one JSON request a line from standard input,
forks, and answers `started PID` and `ended CODE` (negative: a signal). When its input ends, because
whoever asked is gone in whatever way, it ends the job with everything that the job started.

`D2LIO_PLUGINS` names modules, with commas between, that are imported first; they may register
more estimators in `d2lio.hosts.HOSTS`.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import json
import os
import select
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

ERROR_FILE = "error.json"
EXIT_REFUSED = 3
PLUGINS_VARIABLE = "D2LIO_PLUGINS"
PRELOADED = (
    "d2lio.ablate.job",
    "d2lio.datasets.bag",
    "d2lio.datasets.catalog",
    "d2lio.metrics.evo_metrics",
    "d2lio.metrics.time_shift",
    "d2lio._core",
    "d2lio._fastlio",
    "d2lio._liosam",
    "evo.core.metrics",
)
PR_SET_PDEATHSIG = 1


def load_plugins() -> None:
    """Imports the modules that D2LIO_PLUGINS names."""
    for name in filter(None, os.environ.get(PLUGINS_VARIABLE, "").split(",")):
        importlib.import_module(name.strip())


def main() -> None:
    """Serves until the end of standard input."""
    answers = os.dup(1)
    os.dup2(2, 1)  # nothing but answers goes there
    wake = _wake_on_children()
    load_plugins()
    for name in PRELOADED:
        with suppress(ImportError):  # what is missing is said by the run that needs it
            importlib.import_module(name)
    gc.freeze()
    buffer = b""
    while chunk := os.read(0, 1 << 16):
        buffer += chunk
        while b"\n" in buffer:
            line, _, buffer = buffer.partition(b"\n")
            _serve(json.loads(line), answers, wake)


def _serve(request: dict[str, Any], answers: int, wake: int) -> None:
    pid = os.fork()
    if pid == 0:
        os.close(answers)
        _child(request)
    os.write(answers, f"started {pid}\n".encode())
    code = _wait(pid, wake)
    os.write(answers, f"ended {code}\n".encode())


def _wake_on_children() -> int:
    """A pipe that becomes readable when a child ends."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    os.set_blocking(read, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    return read


def _wait(pid: int, wake: int) -> int:
    """The child's exit code; the end of our input ends the child and us."""
    while True:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        ready, _, _ = select.select([0, wake], [], [])
        if wake in ready:
            with suppress(BlockingIOError):
                os.read(wake, 64)
        if 0 in ready and not os.read(0, 1):
            end_group(pid)
            os._exit(0)


def end_group(pid: int) -> None:
    """Kills a job: its process and its process group."""
    for kill in (os.killpg, os.kill):
        with suppress(ProcessLookupError, PermissionError):
            kill(pid, signal.SIGKILL)


def _child(request: dict[str, Any]) -> None:
    """Never returns."""
    code = 1
    try:
        os.setsid()
        _die_with_parent()
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        work = Path(request["work"])
        _redirect(work / request["log"])
        code = _do(request, work)
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _die_with_parent() -> None:
    parent = os.getppid()
    with suppress(OSError, AttributeError):  # Linux alone has it
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _redirect(log: Path) -> None:
    null = os.open(os.devnull, os.O_RDONLY)
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for target, source in ((0, null), (1, file), (2, file)):
        os.dup2(source, target)


def _do(request: dict[str, Any], work: Path) -> int:
    from d2lio.errors import ConfigError, DataError

    try:
        if request["job"] == "cell":
            from d2lio.ablate.cell import CellSpec
            from d2lio.ablate.job import carry_out

            carry_out(CellSpec.model_validate(request["spec"]), work)
        else:
            from d2lio.simulator import simulate

            simulate(**request["spec"])
        return 0
    except (ConfigError, DataError, OSError) as err:
        print(f"error: {err}", file=sys.stderr)
        (work / ERROR_FILE).write_text(json.dumps({"reason": str(err)}), encoding="utf-8")
        return EXIT_REFUSED


if __name__ == "__main__":
    main()
