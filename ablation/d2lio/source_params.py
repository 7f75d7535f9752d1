# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Host parameters that follow from a source: extrinsic, ranges, rings and columns of its LiDAR."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from d2lio.datasets.config import LidarSource, ParamValue, SourceConfig
from d2lio.errors import ConfigError
from d2lio.hosts import NEED_GTSAM
from d2lio.peers import PEERS
from d2lio.peers import settings as peer_settings

# Columns of LIO-SAM's range image by model. 1800 is LIO-SAM's default and what its users keep for
# every Velodyne, the HDL-64E of KITTI included (it fires 2083 times a turn; the first of two
# returns in a cell stays).
COLUMNS = {
    "vlp16": 1800,
    "hdl32e": 1800,
    "hdl64e": 1800,
    "os1_64": 1024,
    "os0_64": 1024,
    "os1_128": 1024,
    "os0_128": 1024,
    "avia": 4000,  # points of a line in a scan: 24 000 in six lines
    "horizon": 4000,
    "mid360": 5000,  # 20 000 in four lines
    "livox": 5000,  # one of them
}
DEFAULT_COLUMNS = 1800
LIVOX = ("avia", "horizon", "mid360", "livox")  # their columns count the points of a line
FRONT_ENDS = {"liosam": "features", "d2lio": "direct"}  # of the hosts, by default
RINGS_USED = 32  # at most: LIO-SAM thins sensors of 64 rings and more by its downsampleRate


def stride_for(rings: int) -> int:
    """Point stride that keeps every ring: 1 up to 32 rings, else 3.

    A stride that shares a factor with the ring count silently removes whole rings of
    column-ordered clouds; 3 shares none with 64 and 128.
    """
    return 1 if rings <= 32 else 3


def ring_step_for(rings: int) -> int:
    """Every how many-th ring LIO-SAM's features use: 1 up to 32 rings, 2 of 64, 4 of 128."""
    return max(1, rings // RINGS_USED)


def columns_of(lidar: LidarSource) -> int:
    """Columns of a sweep: as stated, else those of the model."""
    return lidar.columns or COLUMNS.get(lidar.model.lower(), DEFAULT_COLUMNS)


def range_image(lidar: LidarSource) -> dict[str, str]:
    """Rows and columns of LIO-SAM's range image; without `rings` the host keeps its 16 rows."""
    model = lidar.model.lower()
    params = {
        "Horizon_SCAN": str(columns_of(lidar)),
        "columnByOrder": _text(model in LIVOX),
    }
    if lidar.rings:
        params["N_SCAN"] = str(lidar.rings)
        params["downsampleRate"] = str(ring_step_for(lidar.rings))
    return params


def source_params(
    config: SourceConfig, host: str = "fastlio", extra: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Host parameters that follow from the source, then those of its configuration.

    Args:
        config: the source; its `host` section is for every host, `hosts` by name wins over it.
        host: name of the estimator.
        extra: parameters that are going to be set as well; they only decide the front end here.
    """
    if host in PEERS:  # the `host` section is for ours
        return peer_settings.source_params(config, columns_of(config.lidar))
    own = {key: _text(value) for key, value in (config.host | config.hosts.get(host, {})).items()}
    if host in NEED_GTSAM:
        front_end = (own | dict(extra or {})).get("front_end", FRONT_ENDS[host])
        return _liosam(config, front_end) | own
    return _fastlio(config) | own


def _extrinsic(config: SourceConfig) -> dict[str, str]:
    pose = config.extrinsic
    return {
        "mapping.extrinsic_T": _numbers(pose[:3, 3]),
        "mapping.extrinsic_R": _numbers(pose[:3, :3]),
    }


def _fastlio(config: SourceConfig) -> dict[str, str]:
    lidar = config.lidar
    params = _extrinsic(config) | {
        "preprocess.blind": repr(lidar.min_range_m),
        "point_filter_num": str(stride_for(lidar.rings)),
    }
    if math.isfinite(lidar.max_range_m):
        params["preprocess.max_range"] = repr(lidar.max_range_m)
        params["mapping.det_range"] = repr(lidar.max_range_m)
    return params


def _liosam(config: SourceConfig, front_end: str) -> dict[str, str]:
    lidar = config.lidar
    # A stride would tear the rings apart whose curvature the features come from.
    stride = 1 if front_end == "features" else stride_for(lidar.rings)
    params = _extrinsic(config) | range_image(lidar) | {"point_filter_num": str(stride)}
    # Ranges nobody stated are LIO-SAM's own, 1 and 1000 m.
    if "min_range_m" in lidar.model_fields_set:
        params["preprocess.blind"] = repr(lidar.min_range_m)
    if "max_range_m" in lidar.model_fields_set and math.isfinite(lidar.max_range_m):
        params["preprocess.max_range"] = repr(lidar.max_range_m)
    return params


def _numbers(values: np.ndarray) -> str:
    return "[" + ", ".join(repr(float(v)) for v in np.asarray(values).ravel()) + "]"


def _text(value: ParamValue) -> str:
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
    config: SourceConfig,
    host: str,
    rejection: str | None,
    degeneracy: str | None,
    extra: Mapping[str, str],
) -> dict[str, str]:
    """Source parameters, then mode and method, then `--set`; later ones win."""
    params = source_params(config, host, extra)
    if rejection is not None:
        params["rejection.mode"] = rejection
    if degeneracy is not None:
        params["degeneracy.method"] = degeneracy
    params.update(extra)
    return params
