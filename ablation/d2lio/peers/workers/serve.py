# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The worker: reads messages on standard input, drives a peer, answers on standard output.

Started as `python serve.py DRIVER PARENT_PID` by the interpreter of the peer's environment.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import signal
import sys
import traceback
from importlib.metadata import PackageNotFoundError, version
from typing import Any, BinaryIO

import numpy as np
import wire
from driver import Driver, Pose, RefusedError, Scan, Setup

PR_SET_PDEATHSIG = 1
DRIVERS = {
    "kiss_icp": ("drive_lidar", "KissIcp"),
    "genz_icp": ("drive_lidar", "GenzIcp"),
    "mad_icp": ("drive_lidar", "MadIcp"),
    "small_gicp": ("drive_small_gicp", "SmallGicp"),
    "genz_lio": ("drive_inertial", "GenzLio"),
    "rko_lio": ("drive_inertial", "RkoLio"),
    "se3_lio": ("drive_inertial", "Se3Lio"),
    "pelorus": ("drive_pelorus", "Pelorus"),
    "evalio": ("drive_evalio", "Evalio"),
}


def die_with(parent: int) -> None:
    """Lets the kernel end this process with its parent, however that one ends."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    except (OSError, AttributeError):
        return  # not Linux: the end of standard input has to do
    if os.getppid() != parent:
        os._exit(0)


def take_stdout() -> BinaryIO:
    """The stream for our messages; what the peer prints goes to standard error from now on."""
    stream = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return stream


def read_exactly(size: int) -> bytes:
    """Bytes from standard input; ends the process where there are no more."""
    data = sys.stdin.buffer.read(size)
    if len(data) < size:
        os._exit(0)
    return data


def make_driver(name: str, header: dict[str, Any], arrays: wire.Arrays) -> Driver:
    """The driver, its peer imported and set up."""
    module, kind = DRIVERS[name]
    setup = Setup(T_imu_lidar=arrays["T_imu_lidar"], **header["setup"])
    return getattr(importlib.import_module(module), kind)(setup)


def to_scan(header: dict[str, Any], arrays: wire.Arrays) -> Scan:
    """A scan out of its message."""
    xyz = arrays["xyz"].astype(np.float64)
    intensity = arrays.get("intensity")
    if intensity is None:
        intensity = np.full(len(xyz), 100.0, np.float32)
    return Scan(
        int(header["stamp"]),
        xyz,
        arrays["dt_ns"].astype(np.int64),
        intensity,
        arrays.get("ring"),
    )


def answer(driver: Driver, header: dict[str, Any], arrays: wire.Arrays) -> bytes:
    """Carries out `scan` or `finish` and packs the reply."""
    poses: list[Pose] = []
    reply: dict[str, Any] = {}
    try:
        done = header["op"] == "finish"
        poses = driver.finish() if done else driver.scan(to_scan(header, arrays))
    except RefusedError as err:
        reply["refused"] = str(err)[:300]
    reply["ms"] = 1e3 * driver.busy_s
    reply["memory_mb"] = peak_memory_mb()
    driver.busy_s = 0.0
    matrices = [np.asarray(T, np.float64) for _, T in poses]
    return wire.pack(
        reply,
        {
            "stamps": np.array([stamp for stamp, _ in poses], np.int64),
            "poses": np.array(matrices, np.float64).reshape(-1, 4, 4),
        },
    )


def peak_memory_mb() -> int:
    """Largest resident size of this process, MB; 0 where the system does not tell.

    Not getrusage: its peak is inherited from the parent that was forked.
    """
    try:
        with open("/proc/self/status", encoding="ascii") as file:
            line = next(line for line in file if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        return 0
    return int(line.split()[1]) // 1024


def installed_version(package: str) -> str:
    """Version of a distribution of this environment, empty where it is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def serve(name: str, stream: BinaryIO) -> None:
    """Answers until the input ends."""
    driver: Driver | None = None
    while True:
        header, arrays = wire.unpack(read_exactly)
        if header["op"] == "start":
            driver = make_driver(name, header, arrays)
            reply = wire.pack({"version": installed_version(header["package"])})
        elif driver is None:
            raise RuntimeError(f"{header['op']} before start")
        elif header["op"] == "imu":
            driver.imu.add(arrays["stamps"], arrays["gyro"], arrays["accel"])
            continue
        else:
            reply = answer(driver, header, arrays)
        stream.write(reply)
        stream.flush()


def main() -> None:
    """Entry point. Leaves without destructors: some peers crash in theirs."""
    stream = take_stdout()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    die_with(int(sys.argv[2]))
    try:
        serve(sys.argv[1], stream)
    except BrokenPipeError:
        os._exit(0)
    except BaseException as err:
        traceback.print_exc()
        print(f"error: {type(err).__name__}: {err}", file=sys.stderr, flush=True)
        os._exit(1)


if __name__ == "__main__":
    main()
