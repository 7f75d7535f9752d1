# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The estimators that `d2lio run` can drive, and the parameters a source suggests to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from d2lio.datasets.config import SourceConfig
from d2lio.errors import ConfigError, DataError

REJECTION_MODES = ("off", "none", "fixed", "kiss", "point_adaptive")


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

    def add_imu(self, stamps: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> None:
        """Samples: int64 [N] ns, float64 [N, 3] rad/s, float64 [N, 3] m/s^2."""

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


HOSTS: dict[str, Callable[[], Any]] = {"fastlio": _fastlio}


def load_host(name: str) -> Any:
    """The host class.

    Raises:
        ConfigError: unknown name; DataError: its C++ module is missing.
    """
    if name not in HOSTS:
        raise ConfigError("host", name, ", ".join(HOSTS))
    return HOSTS[name]()


def describe(name: str) -> list[dict[str, str]]:
    """Key, type, default, range, unit and doc of every parameter of a host."""
    return [{k: str(v) for k, v in entry.items()} for entry in load_host(name).describe()]


def _numbers(values: np.ndarray) -> str:
    return "[" + ", ".join(repr(float(v)) for v in np.asarray(values).ravel()) + "]"


def stride_for(rings: int) -> int:
    """Point stride that keeps every ring: 1 up to 32 rings, else 3.

    A stride that shares a factor with the ring count silently removes whole rings of
    column-ordered clouds; 3 shares none with 64 and 128.
    """
    return 1 if rings <= 32 else 3


def source_params(config: SourceConfig) -> dict[str, str]:
    """Host parameters that follow from the source: extrinsic, ranges, stride."""
    pose = config.extrinsic
    params = {
        "mapping.extrinsic_T": _numbers(pose[:3, 3]),
        "mapping.extrinsic_R": _numbers(pose[:3, :3]),
        "preprocess.blind": repr(config.lidar.min_range_m),
        "point_filter_num": str(stride_for(config.lidar.rings)),
    }
    if math.isfinite(config.lidar.max_range_m):
        params["preprocess.max_range"] = repr(config.lidar.max_range_m)
        params["mapping.det_range"] = repr(config.lidar.max_range_m)
    params.update({key: _text(value) for key, value in config.host.items()})
    return params


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return _numbers(np.asarray(value))
    return str(value)


def parse_assignments(assignments: list[str]) -> dict[str, str]:
    """`key=value` texts as a mapping.

    Raises:
        ConfigError: a text without `=` or without a key.
    """
    params = {}
    for text in assignments:
        key, separator, value = text.partition("=")
        if not separator or not key.strip():
            raise ConfigError("--set", text, "key=value")
        params[key.strip()] = value.strip()
    return params


def all_params(
    config: SourceConfig, rejection: str | None, degeneracy: str | None, extra: Mapping[str, str]
) -> dict[str, str]:
    """Source parameters, then mode and method, then `--set`; later ones win."""
    params = source_params(config)
    if rejection is not None:
        params["rejection.mode"] = rejection
    if degeneracy is not None:
        params["degeneracy.method"] = degeneracy
    params.update(extra)
    return params
