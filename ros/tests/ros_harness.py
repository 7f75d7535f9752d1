# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Starts a ROS master, nodes and players for a test, and ends them with it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

SETUP = os.environ.get("D2LIO_ROS_SETUP", "")
START_S = 20.0  # a master or a node that is not there by then will not come


def free_port() -> int:
    """A port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Ros:
    """A master of its own on the loopback interface, and what runs beside it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._port = free_port()
        self._running: list[subprocess.Popen[bytes]] = []
        self._env = {
            "PATH": "/usr/local/bin:/usr/bin:/bin",
            "HOME": str(folder),
            "LANG": "C.UTF-8",
            "ROS_MASTER_URI": f"http://127.0.0.1:{self._port}",
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(folder / "log"),
            "ROS_HOME": str(folder),
            "ROSCONSOLE_STDOUT_LINE_BUFFERED": "1",
            "PYTHONUNBUFFERED": "1",
        }

    def spawn(self, command: str, log: str, **env: str) -> subprocess.Popen[bytes]:
        """Starts a shell command in the ROS environment; its output goes to the file `log`."""
        with (self._folder / log).open("wb") as out:
            process = subprocess.Popen(
                ["bash", "-c", f"source {SETUP} && exec {command}"],
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env=self._env | env,
                start_new_session=True,
            )
        self._running.append(process)
        return process

    def run(self, command: str, log: str = "run.log", timeout: float = 60.0, **env: str) -> int:
        """Runs a command to its end; its exit code."""
        return self.spawn(command, log, **env).wait(timeout)

    def text(self, log: str) -> str:
        """What a command wrote so far."""
        return (self._folder / log).read_text(encoding="utf-8", errors="replace")

    def wait_for(self, log: str, needle: str, timeout: float = START_S) -> None:
        """Waits until a command has written `needle`."""
        end = time.monotonic() + timeout
        while needle not in self.text(log):
            assert time.monotonic() < end, f"no '{needle}' in {log}:\n{self.text(log)}"
            time.sleep(0.05)

    def start_master(self) -> None:
        """Starts roscore and waits for it."""
        self.spawn(f"roscore -p {self._port}", "master.log")
        self.wait_for("master.log", "started core service")

    def node(self, package: str, name: str, **params: object) -> subprocess.Popen[bytes]:
        """Starts `/NAME/odometry_node`; its topics are below /NAME. Dots of keys are `__`."""
        texts = [f"_{key.replace('__', '/')}:='{value}'" for key, value in params.items()]
        node = self.spawn(
            f"rosrun {package} {package} __name:=odometry_node {' '.join(texts)}",
            f"{name}.log",
            ROS_NAMESPACE=f"/{name}",
        )
        self.wait_for(f"{name}.log", "listens to")
        return node

    def play(self, bag: Path, rate: float = 2.0, options: str = "") -> None:
        """Plays a bag to its end; nothing is dropped on the player's side."""
        command = f"rosbag play -q --queue=10000 -d 0.7 -r {rate} {options} {bag}"
        assert self.run(command, "play.log", 120.0) == 0, self.text("play.log")

    @contextlib.contextmanager
    def recording(self, topics: str, bag: Path) -> Iterator[None]:
        """Records topics while the block runs."""
        recorder = self.spawn(f"rosbag record -q -O {bag} {topics} __name:=recorder", "record.log")
        time.sleep(1.5)
        try:
            yield
        finally:
            self.end(recorder)

    @staticmethod
    def end(process: subprocess.Popen[bytes], sign: int = signal.SIGINT) -> int:
        """Ends a process with a signal; its exit code."""
        if process.poll() is None:
            process.send_signal(sign)
        return process.wait(30)

    def end_all(self) -> None:
        """Ends whatever still runs, the master last."""
        for process in reversed(self._running):
            if process.poll() is not None:
                continue
            try:
                self.end(process)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
