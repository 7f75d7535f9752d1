# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The process of a peer, and messages to and from it that never wait for ever."""

from __future__ import annotations

import fcntl
import os
import select
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from d2lio.errors import DataError
from d2lio.peers.workers import wire

WORKERS = Path(__file__).parent / "workers"
PIPE_BYTES = 1 << 20  # a scan in one go; the usual limit of unprivileged processes
CHUNK = 1 << 20
SAID_BYTES = 8192
SAID_LINES = 4
GRACE_S = 2.0
HIDDEN = ("PYTHONPATH", "PYTHONHOME", "EVALIO_CUSTOM")


class PeerProcess:
    """A worker process that ends with us.

    It stays in our process group, so that who ends the group ends it too; on Linux it also dies
    with the thread that started it, hence make it in the thread that uses it.

    Args:
        name: for messages.
        python: interpreter of the peer's environment.
        script: worker; driver: what it shall drive.
        threads: of the libraries that ask the environment.
    """

    def __init__(self, name: str, python: Path, script: Path, driver: str, threads: int) -> None:
        self.name = name
        self._said = tempfile.TemporaryFile()  # noqa: SIM115  # closed by close()
        environment = {k: v for k, v in os.environ.items() if k not in HIDDEN}
        environment |= {
            "OMP_NUM_THREADS": str(threads),
            "OPENBLAS_NUM_THREADS": "1",
            "RAYON_NUM_THREADS": str(threads),
            "MPLBACKEND": "Agg",
        }
        # -s: no packages of the user's own directory; -u: what it says is there when it dies
        command = [str(python), "-s", "-u", str(script), driver, str(os.getpid())]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                env=environment,
                bufsize=0,
            )
        except OSError as err:
            self._said.close()
            raise DataError(f"{name}: {python}: {err.strerror}") from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin.fileno(), self._process.stdout.fileno()
        for fd in (self._in, self._out):
            os.set_blocking(fd, False)
            _widen(fd)

    def ask(
        self,
        header: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray],
        timeout_s: float,
    ) -> tuple[dict[str, Any], wire.Arrays]:
        """Sends a message and waits for the answer.

        Raises:
            DataError: the worker ended, took longer, or answered nonsense; it has ended then.
        """
        self.tell(header, arrays, timeout_s)
        deadline = time.monotonic() + timeout_s
        what = str(header["op"])
        try:
            return wire.unpack(lambda size: self._read(size, deadline, what, timeout_s))
        except wire.WireError as err:
            raise self._failed(f"answered with {err}") from None

    def tell(
        self,
        header: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray],
        timeout_s: float,
    ) -> None:
        """Sends a message that has no answer; raises DataError as `ask` does."""
        data = memoryview(wire.pack(header, arrays))
        deadline = time.monotonic() + timeout_s
        while data:
            self._wait([], [self._in], deadline, str(header["op"]), timeout_s)
            try:
                data = data[os.write(self._in, data[:CHUNK]) :]
            except BlockingIOError:
                continue
            except OSError:
                raise self._ended() from None

    def _read(self, size: int, deadline: float, what: str, timeout_s: float) -> bytes:
        parts: list[bytes] = []
        while size:
            self._wait([self._out], [], deadline, what, timeout_s)
            try:
                part = os.read(self._out, min(size, CHUNK))
            except BlockingIOError:
                continue
            if not part:
                raise self._ended()
            parts.append(part)
            size -= len(part)
        return b"".join(parts)

    def _wait(
        self, read: list[int], write: list[int], deadline: float, what: str, timeout_s: float
    ) -> None:
        left = deadline - time.monotonic()
        if left <= 0.0 or not any(select.select(read, write, [], left)):
            raise self._failed(f"took longer than {timeout_s:g} s ({what})")

    def _ended(self) -> DataError:
        """The pipe is closed: the process ends or has ended."""
        try:
            code = self._process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            return self._failed("closed its output")
        if code >= 0:
            return self._failed(f"ended with exit code {code}")
        try:
            return self._failed(f"crashed ({signal.Signals(-code).name})")
        except ValueError:
            return self._failed(f"crashed (signal {-code})")

    def _failed(self, what: str) -> DataError:
        self.close()
        said = self.said()
        return DataError(f"{self.name} {what}" + (f"; it said: {said}" if said else ""))

    def said(self) -> str:
        """The last lines of the worker's standard error."""
        if self._said.closed:
            return self._last_words
        size = self._said.seek(0, os.SEEK_END)
        self._said.seek(max(0, size - SAID_BYTES))
        lines = self._said.read().decode(errors="replace").splitlines()
        return " / ".join([line.strip() for line in lines if line.strip()][-SAID_LINES:])

    _last_words = ""

    def close(self) -> None:
        """Ends the worker, at once."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None and not stream.closed:
                stream.close()
        if not self._said.closed:
            self._last_words = self.said()
            self._said.close()


def _widen(fd: int) -> None:
    try:
        fcntl.fcntl(fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)  # type: ignore[attr-defined]
    except (OSError, AttributeError):
        return  # slower, not wrong
