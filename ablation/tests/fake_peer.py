# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A peer's worker that goes straight ahead, or misbehaves as its first argument says."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

WORKERS = Path(__file__).parents[1] / "d2lio" / "peers" / "workers"
sys.path.insert(0, str(WORKERS))
import wire  # noqa: E402  # the worker side has no d2lio

SPEED = 2.0  # m/s along x
MISBEHAVE_AT = 3  # scans


def answer(stamps: list[int], start: int) -> bytes:
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, 0, 3] = [SPEED * (stamp - start) * 1e-9 for stamp in stamps]
    reply = {"ms": 1.5, "memory_mb": 7}
    return wire.pack(reply, {"stamps": np.array(stamps, np.int64), "poses": poses})


def misbehave(how: str, stamp: int, start: int) -> bytes:
    """The answer to scan number MISBEHAVE_AT, if there is one."""
    if how == "crash":
        os.abort()
    if how == "hang":
        time.sleep(3600.0)
    if how == "exit":
        print("error: out of luck", file=sys.stderr, flush=True)
        os._exit(7)
    if how == "garbage":
        return b"Iteration 1: cost 0.5\n" * 10
    if how == "too_many":
        return answer([stamp, stamp + 1], start)
    if how == "nonsense":
        return wire.pack({"ms": 1.0, "memory_mb": 1}, {"stamps": np.zeros(2, np.int64)})
    if how == "refuses":
        reply = {"ms": 0.5, "memory_mb": 7, "refused": "too few points"}
        none = {"stamps": np.zeros(0, np.int64), "poses": np.zeros((0, 4, 4))}
        return wire.pack(reply, none)
    if how == "repeats":
        return answer([start], start)
    return answer([stamp], start)


def read(size: int) -> bytes:
    data = sys.stdin.buffer.read(size)
    if len(data) < size:
        os._exit(0)
    return data


def main() -> None:
    how = sys.argv[1]
    scans, start = 0, 0
    while True:
        header, arrays = wire.unpack(read)
        if header["op"] == "imu":
            continue
        if header["op"] == "start":
            reply = wire.pack({"version": str(os.getpid())})
        elif header["op"] == "finish":
            reply = answer([], 0)
        else:
            stamp = header["stamp"] + int(arrays["dt_ns"].max())
            start = start or stamp
            good = scans != MISBEHAVE_AT and how != "refuses_all"
            reply = (
                answer([stamp], start)
                if good
                else misbehave(how.removesuffix("_all"), stamp, start)
            )
            scans += 1
        sys.stdout.buffer.write(reply)
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
