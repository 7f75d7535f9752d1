# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The estimators that `d2lio run` can drive."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np

from d2lio.errors import ConfigError, DataError
from d2lio.peers import PEERS

REJECTION_MODES = ("off", "none", "fixed", "kiss", "point_adaptive")
LIOSAM_MODULE = "d2lio._liosam"


class ScanResult(Protocol):
    """Outcome of one scan.

    Attributes:
        stamp: end of the scan, ns.
        status: what the estimator did with it.
        health: INIT, OK, DEGENERATE or LOST.
        has_pose: false while the estimator initialises.
        T_map_imu: float64 [4, 4], m, at `stamp`.
        velocity, gyro_bias, accel_bias, gravity: float64 [3], SI units, map and body frame.
        covariance: float64 [6, 6], order x y z rx ry rz.
        diagnostics: flat record, one CSV row.
    """

    stamp: int
    status: str
    health: str
    has_pose: bool
    T_map_imu: np.ndarray
    diagnostics: dict[str, float | int | str]


class Host(Protocol):
    """What every estimator offers (the C++ hosts do)."""

    def add_imu(
        self,
        stamps: np.ndarray,
        gyro: np.ndarray,
        accel: np.ndarray,
        orientation: np.ndarray | None = None,
    ) -> None:
        """Samples: int64 [N] ns, float64 [N, 3] rad/s, float64 [N, 3] m/s^2.

        `orientation` is that of a 9-axis IMU, float64 [N, 4], x y z w of R_world_imu; rows of zeros
        where there is none.
        """

    def add_scan(
        self,
        stamp: int,
        xyz: np.ndarray,
        dt_ns: np.ndarray,
        intensity: np.ndarray | None,
        ring: np.ndarray | None,
    ) -> None:
        """One sweep: ns, float32 [N, 3] m, int32 [N] ns, float32 [N], uint16 [N]."""

    def step(self) -> ScanResult | None:
        """Processes the next scan whose IMU data is complete; None needs more input."""

    def finish(self) -> None:
        """End of input: what is left becomes processable."""

    def counts(self) -> dict[str, int]:
        """Drops by reason, epochs and the like."""


HostFactory = Callable[[dict[str, str], int], Host]


def _fastlio() -> Any:
    try:
        from d2lio._fastlio import FastLioHost
    except ImportError as err:
        raise DataError(f"the FAST-LIO host is not built ({err}); run `pip install .`") from None
    return FastLioHost


def _liosam(name: str) -> Any:
    why = liosam_missing()
    if why is not None:
        raise DataError(why)
    from d2lio import _liosam as module

    return getattr(module, name)


def liosam_missing() -> str | None:
    """Why the LIO-SAM host and D²-LIO cannot be had here; None where they can."""
    if find_spec(LIOSAM_MODULE) is not None:
        return None
    return (
        "the LIO-SAM host and D²-LIO are not built: this installation was made without GTSAM 4.2; "
        "run `D2LIO_GTSAM=on ./d2lio setup`, or `pip install .` where CMake finds GTSAM"
    )


HOSTS: dict[str, Callable[[], Any]] = {
    "fastlio": _fastlio,
    "liosam": lambda: _liosam("LioSamHost"),
    "d2lio": lambda: _liosam("D2LioHost"),
}
NEED_GTSAM = ("liosam", "d2lio")
TITLES = {"fastlio": "FAST-LIO2 host", "liosam": "LIO-SAM host", "d2lio": "D²-LIO"}
SHORT_TITLES = {"fastlio": "FAST-LIO2", "liosam": "LIO-SAM", "d2lio": "D²-LIO"}
TITLES |= {name: peer.title for name, peer in PEERS.items()}
SHORT_TITLES |= {name: peer.title for name, peer in PEERS.items()}


def load_host(name: str) -> Any:
    """The host class; for a peer (see `d2lio.peers`) what makes a host of it.

    Raises:
        ConfigError: unknown name; DataError: its C++ module is missing.
    """
    if name in PEERS:
        from d2lio.peers.host import factory

        return factory(name)
    if name not in HOSTS:
        raise ConfigError("host", name, ", ".join([*HOSTS, *PEERS]))
    return HOSTS[name]()


def describe(name: str) -> list[dict[str, str]]:
    """Key, type, default, range, unit and doc of every parameter of a host."""
    return [{k: str(v) for k, v in entry.items()} for entry in load_host(name).describe()]
