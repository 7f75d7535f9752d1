# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`./d2lio launch compare`: compare.launch on a roscore of its own, on loopback, from start to end.

What is started is ended again, also when the command is interrupted or terminated.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import yaml

from d2lio.ablate.results import RESULTS_FILE, load_rows
from d2lio.compare.collect import META_FILE
from d2lio.compare.material import Material
from d2lio.datasets import open_source
from d2lio.datasets.recognise import find_truth, recognise
from d2lio.datasets.truth import read_truth, write_truth
from d2lio.errors import DataError
from d2lio.sequence import FILE_NAME

PROGRAM_VARIABLE = "D2LIO_PROGRAM"
CONFIG_FILE, TRUTH_FILE = "source.yaml", "ground_truth.tum"
LOGS = "ros"
MASTER_UP_S = 30.0
STOP_S = 120.0  # for the variants to save and for the report
GRACE_S = 5.0
PR_SET_PDEATHSIG = 1
EXIT_FAILED, EXIT_INTERRUPTED, EXIT_TERMINATED = 4, 130, 143


@dataclass(frozen=True, slots=True)
class LaunchOptions:
    """What compare.launch is given; see there.

    Attributes:
        variants, host: names as given.
        rate: of the bag.
        headless: no RViz, and the end of the bag is the end.
    """

    variants: str
    host: str = "fastlio"
    rate: float = 1.0
    threads: int = 1
    headless: bool = False


def missing() -> str | None:
    """Why nothing can be launched here; None where it can."""
    if shutil.which("roslaunch") is None or shutil.which("roscore") is None:
        return "ROS 1 is not set up in this environment; ./d2lio launch installs and builds it"
    return None


def launch(material: Material, out: Path, options: LaunchOptions) -> int:
    """Runs it; 0, 4 when no variant gave a trajectory, 130 interrupted, 143 terminated.

    Raises:
        DataError: no ROS, no ROS 1 bag, or no master.
    """
    if (why := missing()) is not None:
        raise DataError(why)
    bag, arguments = _files(material, out)
    out.mkdir(parents=True, exist_ok=True)
    for stale in (RESULTS_FILE, META_FILE):
        (out / stale).unlink(missing_ok=True)
    port = _free_port()
    with _Processes(_environment(os.environ, port, out)) as processes:
        core = processes.start(["roscore", "-p", str(port)], out / "roscore.log")
        _wait_for_master(core, port)
        shown = "false" if options.headless else "true"
        command = [
            "roslaunch", "--no-summary", "--disable-title", "--skip-log-check",
            f"--sigint-timeout={STOP_S:g}",
            "d2lio_fastlio", "compare.launch", f"bag:={bag}", f"variants:={options.variants}",
            f"host:={options.host}", f"out:={out}", f"rate:={options.rate:g}", f"rviz:={shown}",
            f"threads:={options.threads}", *arguments,
        ]  # fmt: skip
        told = processes.follow(processes.start(command))
    if told is not None:
        return {signal.SIGINT: EXIT_INTERRUPTED}.get(told, EXIT_TERMINATED)
    return 0 if _something_ran(out) else EXIT_FAILED


def _files(material: Material, out: Path) -> tuple[Path, list[str]]:
    """The bag, and the arguments that describe it."""
    path = material.origin.path
    if material.origin.simulation is not None and not path.exists():
        _simulate(material, path)
    if (path / FILE_NAME).is_file() and material.config is None:
        bag, arguments = _of_sequence(path)
    else:
        bag, arguments = path, _of_recording(material, out)
    if bag.suffix != ".bag":
        raise DataError(f"{bag}: not a ROS 1 bag; `d2lio compare` runs without ROS")
    if material.truth is not None:
        arguments.append(f"truth:={material.truth.absolute()}")
    return bag.absolute(), arguments


def _simulate(material: Material, place: Path) -> None:
    from d2lio.simulator import simulate

    place.parent.mkdir(parents=True, exist_ok=True)
    simulate(**(material.origin.simulation or {}), out=place)


def _of_sequence(path: Path) -> tuple[Path, list[str]]:
    from d2lio.sequence import Sequence

    return Sequence.load(path).bag_path, [f"config:={(path / FILE_NAME).absolute()}"]


def _of_recording(material: Material, out: Path) -> list[str]:
    """Writes down what is known of a recording, and its truth as poses of the IMU."""
    source = open_source(material.origin.path, material.config)
    out.mkdir(parents=True, exist_ok=True)
    data = source.config.model_dump(exclude_none=True, exclude={"ground_truth"})
    data["name"] = source.name
    (out / CONFIG_FILE).write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    arguments = [f"config:={out / CONFIG_FILE}"]
    if material.truth is not None:
        return arguments
    if source.ground_truth is not None:
        return [*arguments, f"truth:={source.ground_truth.absolute()}"]
    match = recognise(material.origin.path, {})
    file = None if match is None else find_truth(material.origin.path, match)
    if match is not None and match.truth is not None and file is not None:
        write_truth(out / TRUTH_FILE, read_truth(file, match.truth, match.device_name))
        arguments.append(f"truth:={out / TRUTH_FILE}")
    return arguments


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _environment(given: Mapping[str, str], port: int, out: Path) -> dict[str, str]:
    """A master of our own on loopback, logs below `out`, results by this very program."""
    own = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(out / LOGS),
        PROGRAM_VARIABLE: shlex.join([sys.executable, "-m", "d2lio"]),
    }
    kept = {key: value for key, value in given.items() if key != "ROS_HOSTNAME"}
    return kept | own


def _wait_for_master(core: subprocess.Popen[bytes], port: int) -> None:
    end = time.monotonic() + MASTER_UP_S
    while time.monotonic() < end and core.poll() is None:
        with suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 1.0).close()
            return
        time.sleep(0.2)
    raise DataError("roscore does not start; see roscore.log in the output directory")


def _something_ran(out: Path) -> bool:
    with suppress(DataError):
        return any(row.scans_processed for row in load_rows(out))
    return False


class _Processes:
    """Processes that end with the block, the last one first, each with its group."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = environment
        self._all: list[subprocess.Popen[bytes]] = []
        self._told: int | None = None
        self._former: dict[int, object] = {}

    def __enter__(self) -> _Processes:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._former[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._all):
            _end(process)
        for number, handler in self._former.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        self._told = number

    def start(self, command: list[str], log: Path | None = None) -> subprocess.Popen[bytes]:
        """Starts a process in a session of its own; Ctrl-C reaches it through us."""
        if self._told is not None:
            raise KeyboardInterrupt
        with nullcontext() if log is None else log.open("wb") as stream:
            process = subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=None if log is None else subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_end_with_us,
            )
        self._all.append(process)
        return process

    def follow(self, process: subprocess.Popen[bytes]) -> int | None:
        """Waits for it; hands a signal on as SIGINT, so that all is saved, and returns it."""
        while process.poll() is None and self._told is None:
            time.sleep(0.1)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(STOP_S)
        return self._told


def _end_with_us() -> None:
    """Has the child told to end when we are killed (Linux alone can)."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a process and what is left of its group."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            break
        process.send_signal(number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_S)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
