# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a peer: those every peer takes from the source, and its own."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from d2lio.errors import ConfigError
from d2lio.peers.catalog import Peer, Setting, Value

if TYPE_CHECKING:
    from d2lio.datasets.config import SourceConfig

TRANSLATION, ROTATION = "mapping.extrinsic_T", "mapping.extrinsic_R"
OF_OUR_HOSTS = ("rejection.", "degeneracy.")
MAX_RANGE_M = 100.0  # where the source states none: the packages want a number
TIMEOUT = Setting("timeout_s", 60.0, 0.1, 3600.0, "s", "a scan that takes longer ends the run")
SOURCE = (
    Setting("lidar.rings", 0, 0, 1024, "", "0: unknown"),
    Setting("lidar.columns", 1800, 1, 16384, "", "firings of a ring in a turn"),
    Setting("lidar.rate_hz", 10.0, 0.1, 1000.0, "Hz", "sweeps"),
    Setting("lidar.min_range_m", 0.5, 0.0, 1000.0, "m", "nearer points are left out"),
    Setting("lidar.max_range_m", MAX_RANGE_M, 0.1, 10000.0, "m", "farther points are left out"),
    Setting("imu.rate_hz", 200.0, 1.0, 10000.0, "Hz", "of the IMU"),
)
IDENTITY_R = "[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]"
ROTATION_TOLERANCE = 1e-3


def describe(peer: Peer) -> list[dict[str, str]]:
    """Key, type, default, range, unit and doc of every parameter."""
    rows = [_row(setting) for setting in (*peer.settings, TIMEOUT, *SOURCE)]
    texts = (
        ("lidar.model", "string", "", "", "", "of the LiDAR; decides what the sensor dictates"),
        (TRANSLATION, "vec3", "[0.0, 0.0, 0.0]", "", "m", "LiDAR in the IMU frame"),
        (ROTATION, "mat3", IDENTITY_R, "SO(3)", "", "R_imu_lidar, by rows"),
    )
    keys = ("key", "type", "default", "range", "unit", "doc")
    return rows + [dict(zip(keys, text, strict=True)) for text in texts]


def _row(setting: Setting) -> dict[str, str]:
    return {
        "key": setting.key,
        "type": setting.kind,
        "default": _text(setting.default),
        "range": _allowed(setting),
        "unit": setting.unit,
        "doc": setting.text,
    }


def _text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _allowed(setting: Setting) -> str:
    if isinstance(setting.default, bool):
        return "true, false"
    return f"[{setting.low:g}, {setting.high:g}]"


def read(peer: Peer, params: Mapping[str, str]) -> dict[str, Any]:
    """Values of all parameters, defaults where none is given.

    Raises:
        ConfigError: unknown key, or a value out of range.
    """
    known = {setting.key: setting for setting in (*peer.settings, TIMEOUT, *SOURCE)}
    values: dict[str, Any] = {key: setting.default for key, setting in known.items()}
    values |= {"lidar.model": "", TRANSLATION: np.zeros(3), ROTATION: np.eye(3)}
    for key, text in params.items():
        if key.startswith(OF_OUR_HOSTS):
            raise ConfigError(key, text, f"nothing: {peer.title} has no such stage to set")
        if key in (TRANSLATION, ROTATION):
            values[key] = _matrix(key, text)
        elif key == "lidar.model":
            values[key] = text.lower()
        elif key in known:
            values[key] = _value(known[key], text)
        else:
            raise ConfigError(key, text, f"no such key; known: {', '.join(values)}")
    return values


def _value(setting: Setting, text: str) -> Value:
    allowed = _allowed(setting)
    if isinstance(setting.default, bool):
        if text.lower() not in ("true", "false"):
            raise ConfigError(setting.key, text, allowed)
        return text.lower() == "true"
    try:
        value = type(setting.default)(text)
    except ValueError:
        raise ConfigError(setting.key, text, f"{setting.kind} in {allowed}") from None
    if not setting.low <= value <= setting.high:
        raise ConfigError(setting.key, text, allowed)
    return value


def _matrix(key: str, text: str) -> np.ndarray:
    shape = (3,) if key == TRANSLATION else (3, 3)
    try:
        matrix = np.asarray(json.loads(text), float).reshape(shape)
    except (ValueError, TypeError):
        raise ConfigError(key, text, f"{math.prod(shape)} numbers in brackets") from None
    if not np.isfinite(matrix).all():
        raise ConfigError(key, text, "finite numbers")
    if key == ROTATION:
        error = np.abs(matrix @ matrix.T - np.eye(3)).max()
        if error > ROTATION_TOLERANCE or np.linalg.det(matrix) < 0.0:
            raise ConfigError(key, text, "a rotation in SO(3)")
    return matrix


def source_params(config: SourceConfig, columns: int) -> dict[str, str]:
    """What a peer is told about the source, as texts.

    Args:
        config: the source.
        columns: of its LiDAR.
    """
    lidar, pose = config.lidar, config.extrinsic
    farthest = lidar.max_range_m if math.isfinite(lidar.max_range_m) else MAX_RANGE_M
    return {
        TRANSLATION: _numbers(pose[:3, 3]),
        ROTATION: _numbers(pose[:3, :3]),
        "lidar.model": lidar.model,
        "lidar.rings": str(lidar.rings),
        "lidar.columns": str(columns),
        "lidar.rate_hz": repr(lidar.rate_hz),
        "lidar.min_range_m": repr(lidar.min_range_m),
        "lidar.max_range_m": repr(farthest),
        "imu.rate_hz": repr(config.imu.rate_hz),
    }


def _numbers(values: np.ndarray) -> str:
    return json.dumps([float(value) for value in np.asarray(values).ravel()])
