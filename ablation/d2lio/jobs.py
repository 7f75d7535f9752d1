# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs commands in processes of their own, so that one crash is one failed row."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

TERMINATE_GRACE_S = 5.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a process ended; `reason` is empty when it ended well."""

    code: int
    reason: str = ""

    @property
    def ok(self) -> bool:
        """Whether it ended with exit code 0."""
        return self.code == 0


def d2lio_command(*arguments: str) -> list[str]:
    """The command line of this package under this interpreter."""
    return [sys.executable, "-m", "d2lio", *arguments]


def run_process(command: list[str], log: Path, timeout_s: float | None = None) -> Outcome:
    """Runs a command to its end, everything it says going to `log`.

    On Ctrl-C the process is ended before KeyboardInterrupt goes on.
    """
    with log.open("w", encoding="utf-8") as stream:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT
        )
        try:
            code = process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return Outcome(-signal.SIGKILL, f"took longer than {timeout_s:.0f} s")
        except BaseException:
            _end(process)
            raise
    return Outcome(code, "" if code == 0 else _reason(code, log))


def _end(process: subprocess.Popen) -> None:
    process.terminate()
    try:
        process.wait(TERMINATE_GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _reason(code: int, log: Path) -> str:
    if code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        return f"crashed ({name})"
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines()]
    errors = [line for line in lines if line.startswith("error:")]
    said = (errors or [line for line in lines if line] or [""])[-1].removeprefix("error:").strip()
    return said[:300] or f"exit code {code}"
