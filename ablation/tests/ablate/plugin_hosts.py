# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Estimators that misbehave, for the processes of runs (D2LIO_PLUGINS=plugin_hosts)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from d2lio import hosts
from fakes import FakeHost, FakeResult

FAIL_AT = 3  # the scan at which it happens
HOG_MB = 300


class _Misbehaving(FakeHost):
    def step(self) -> FakeResult | None:
        result = super().step()
        if result is not None and self._done == FAIL_AT:
            self.misbehave()
        return result

    def misbehave(self) -> None:
        raise NotImplementedError


class Crash(_Misbehaving):
    def misbehave(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)


class Raise(_Misbehaving):
    def misbehave(self) -> None:
        raise RuntimeError("a bug")


class Hang(_Misbehaving):
    """Hangs with a child process beside it, as a peer does."""

    def misbehave(self) -> None:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        pids = Path(os.environ["HANG_PIDS"])
        pids.write_text(f"{os.getpid()} {child.pid}", encoding="utf-8")
        time.sleep(600.0)


class Hog(_Misbehaving):
    """Takes memory in a child process and waits."""

    def misbehave(self) -> None:
        code = f"import time; hog = b'x' * ({HOG_MB} << 20); time.sleep(600)"
        subprocess.Popen([sys.executable, "-c", code]).wait()


class Terminated(_Misbehaving):
    """Somebody ends the run from outside."""

    def misbehave(self) -> None:
        os.kill(os.getpid(), signal.SIGTERM)


class Astray(FakeHost):
    """Leaves on a wide curve."""

    def step(self) -> FakeResult | None:
        result = super().step()
        if result is not None:
            way = result.T_map_imu[0, 3]
            result.T_map_imu[1:3, 3] = 0.1 * way**2, 0.05 * way**3
        return result


for _name, _host in {
    "fake": FakeHost,
    "crash": Crash,
    "raise": Raise,
    "hang": Hang,
    "hog": Hog,
    "terminated": Terminated,
    "astray": Astray,
}.items():
    hosts.HOSTS[_name] = lambda host=_host: host
