# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A peer behind the interface of our own hosts."""

from __future__ import annotations

import weakref
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from d2lio.errors import ConfigError, DataError
from d2lio.peers import environments, settings
from d2lio.peers.catalog import PEERS, Peer
from d2lio.peers.pipe import WORKERS, PeerProcess
from d2lio.peers.workers import wire

START_TIMEOUT_S = 120.0  # at least: imports on a loaded machine


@dataclass(frozen=True, slots=True)
class PeerResult:
    """Outcome of a scan, as `d2lio.hosts.ScanResult`; a peer gives poses and nothing more.

    `stamp` is the instant the peer's pose refers to.
    """

    stamp: int
    status: str
    health: str
    has_pose: bool
    T_map_imu: np.ndarray
    diagnostics: dict[str, float | int | str]
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gyro_bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    accel_bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gravity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    covariance: np.ndarray = field(default_factory=lambda: np.full((6, 6), np.nan))


@dataclass(frozen=True, slots=True)
class _Waiting:
    stamp: int
    end: int
    arrays: dict[str, np.ndarray]


class PeerHost:
    """Drives a peer in its own environment.

    Args:
        peer: which.
        params: see `describe`.
        threads: of the peer.

    Raises:
        ConfigError: a refused parameter; DataError: not installed, or it does not start.
    """

    def __init__(self, peer: Peer, params: dict[str, str], threads: int = 1) -> None:
        self._peer = peer
        values = settings.read(peer, params)
        self._timeout_s = float(values["timeout_s"])
        self._range_m = (values["lidar.min_range_m"], values["lidar.max_range_m"])
        self._scans: deque[_Waiting] = deque()
        self._ready: deque[PeerResult] = deque()
        self._newest_imu = self._newest_scan = self._newest_pose = -(1 << 62)
        self._finished = False
        self._ms = 0.0  # of scans whose pose has not come
        self._refusal = ""
        self._counts = dict.fromkeys(
            ("scans_given", "scans_refused", "scans_empty", "scans_dropped_late", "poses",
             "poses_out_of_order", "imu_accepted", "imu_dropped_late", "worker_peak_memory_mb"),
            0,
        )  # fmt: skip
        python = environments.interpreter(peer)
        script = WORKERS / peer.worker
        self._worker = PeerProcess(peer.name, python, script, peer.driver, threads)
        self._end = weakref.finalize(self, self._worker.close)
        self.version = self._start(values, threads)

    def _start(self, values: dict[str, Any], threads: int) -> str:
        peer, T = self._peer, np.eye(4)
        T[:3, :3], T[:3, 3] = values[settings.ROTATION], values[settings.TRANSLATION]
        own: dict[str, Any] = {setting.key: values[setting.key] for setting in peer.settings}
        setup = {key.split(".")[1]: values[key] for key in values if key.startswith("lidar.")}
        setup |= {"imu_rate_hz": values["imu.rate_hz"], "threads": threads}
        setup["params"] = own | dict(peer.fixed)
        start = {"op": "start", "package": peer.package, "setup": setup}
        timeout = max(START_TIMEOUT_S, self._timeout_s)
        reply, _ = self._worker.ask(start, {"T_imu_lidar": T}, timeout)
        return str(reply.get("version", ""))

    def add_imu(
        self,
        stamps: np.ndarray,
        gyro: np.ndarray,
        accel: np.ndarray,
        orientation: np.ndarray | None = None,
    ) -> None:
        """See `Host`; attitudes are not handed on: no peer here takes them."""
        if len(stamps) == 0:
            return
        newest = np.maximum.accumulate(np.concatenate([[self._newest_imu], stamps]))
        good = (stamps > newest[:-1]) & np.isfinite(gyro).all(1) & np.isfinite(accel).all(1)
        self._newest_imu = int(newest[-1])
        self._counts["imu_dropped_late"] += int((~good).sum())
        self._counts["imu_accepted"] += int(good.sum())
        if self._peer.needs_imu:
            arrays = {"stamps": stamps[good], "gyro": gyro[good], "accel": accel[good]}
            self._worker.tell({"op": "imu"}, arrays, self._timeout_s)

    def add_scan(
        self,
        stamp: int,
        xyz: np.ndarray,
        dt_ns: np.ndarray,
        intensity: np.ndarray | None,
        ring: np.ndarray | None,
    ) -> None:
        """See `Host`; points without a range, or out of the LiDAR's, are left out."""
        ranges = np.linalg.norm(xyz, axis=1)
        # False for NaN; a range of 0 is a missing return
        good = (ranges > max(self._range_m[0], 0.0)) & (ranges < self._range_m[1])
        if not good.any():
            self._counts["scans_empty"] += 1
            return
        end = stamp + int(dt_ns[good].max())
        if end <= self._newest_scan:  # a bag that begins anew: no peer can
            self._counts["scans_dropped_late"] += 1
            return
        self._newest_scan = end
        arrays = {"xyz": xyz[good], "dt_ns": dt_ns[good]}
        for name, values in (("intensity", intensity), ("ring", ring)):
            if values is not None:
                arrays[name] = values[good]
        self._scans.append(_Waiting(stamp, end, arrays))

    def step(self) -> PeerResult | None:
        """The next pose, or a scan that was refused; None needs more input."""
        while not self._ready and self._scans and self._complete(self._scans[0]):
            scan = self._scans.popleft()
            self._counts["scans_given"] += 1
            self._receive({"op": "scan", "stamp": scan.stamp}, scan.arrays, scan.end)
        if self._finished and not self._scans and self._end.alive:
            self._receive({"op": "finish"}, {}, self._newest_scan)
            self._leave()
        return self._ready.popleft() if self._ready else None

    def _complete(self, scan: _Waiting) -> bool:
        return self._finished or not self._peer.needs_imu or self._newest_imu > scan.end

    def _receive(self, header: dict[str, Any], arrays: wire.Arrays, end: int) -> None:
        reply, found = self._worker.ask(header, arrays, self._timeout_s)
        try:
            stamps, poses = found["stamps"].astype(np.int64), found["poses"].astype(np.float64)
            self._ms += float(reply["ms"])
            self._counts["worker_peak_memory_mb"] = int(reply["memory_mb"])
            if poses.shape != (len(stamps), 4, 4):
                raise ValueError(f"{poses.shape} poses")
        except (KeyError, ValueError, TypeError) as err:
            self._end()
            raise DataError(f"{self._peer.name} answered with nonsense: {err}") from None
        if "refused" in reply:
            self._refuse(str(reply["refused"]), end)
        self._take(stamps, poses)

    def _refuse(self, reason: str, end: int) -> None:
        self._refusal = reason
        self._counts["scans_refused"] += 1
        health = "LOST" if self._counts["poses"] else "INIT"
        row = _row(end, "refused", health, self._ms)
        self._ms = 0.0
        self._ready.append(PeerResult(end, "refused", health, False, np.eye(4), row))

    def _take(self, stamps: np.ndarray, poses: np.ndarray) -> None:
        if self._counts["poses"] + len(stamps) > self._counts["scans_given"]:
            self._end()
            raise DataError(f"{self._peer.name} gave more poses than scans")
        share = self._ms / max(1, len(stamps))
        for stamp, pose in zip(stamps.tolist(), poses, strict=True):
            if stamp <= self._newest_pose:
                self._counts["poses_out_of_order"] += 1
                continue
            self._newest_pose = stamp
            self._counts["poses"] += 1
            row = _row(stamp, "ok", "OK", share)
            self._ready.append(PeerResult(stamp, "ok", "OK", True, pose, row))
        if len(stamps):
            self._ms = 0.0

    def _leave(self) -> None:
        self._end()
        if self._counts["scans_given"] and not self._counts["poses"]:
            why = f": {self._refusal}" if self._refusal else ""
            raise DataError(f"{self._peer.name} gave no pose{why}")

    def finish(self) -> None:
        """See `Host`."""
        self._finished = True

    def counts(self) -> dict[str, int]:
        """Scans, poses and samples by what became of them; the worker's memory, MB."""
        return dict(self._counts)


def _row(stamp: int, status: str, health: str, ms: float) -> dict[str, float | int | str]:
    return {"stamp_ns": stamp, "status": status, "health": health, "time_total_ms": ms}


class PeerFactory:
    """What `d2lio.hosts.load_host` gives for a peer: called, it makes the host."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer

    def __call__(self, params: dict[str, str], threads: int = 1) -> PeerHost:
        """Starts the peer; see `PeerHost`."""
        return PeerHost(self.peer, params, threads)

    def describe(self) -> list[dict[str, str]]:
        """Key, type, default, range, unit and doc of every parameter."""
        return settings.describe(self.peer)


def factory(name: str) -> PeerFactory:
    """The factory of a peer; raises ConfigError for an unknown name."""
    if name not in PEERS:
        raise ConfigError("peer", name, ", ".join(PEERS))
    return PeerFactory(PEERS[name])


__all__ = ["PeerFactory", "PeerHost", "PeerResult", "factory"]
