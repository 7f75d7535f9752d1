# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Public data sets that are known: devices, topics, extrinsics, ground truth, sequences."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict
from scipy.spatial.transform import Rotation

from d2lio.datasets.config import ImuSource, LidarSource, ParamValue, SourceConfig
from d2lio.errors import ConfigError

FOLDER = Path(__file__).parent / "known"
ROUNDED = 1e-6  # a published rotation further than this from SO(3) deserves a note


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", protected_namespaces=(), frozen=True)


class Stream(_Strict):
    """A LiDAR topic and its message type in the long form pkg/msg/Type."""

    topic: str
    type: str


class Extrinsic(_Strict):
    """T_imu_lidar as published: R by rows, t in m. `exact` false: a guess, see `note`."""

    R: list[list[float]]
    t: list[float]
    exact: bool = True
    note: str = ""

    @property
    def rotation_error(self) -> float:
        """Largest entry of R R^T - I."""
        R = np.asarray(self.R)
        return float(np.abs(R @ R.T - np.eye(3)).max())

    def matrix(self) -> np.ndarray:
        """float64 [4, 4], its rotation the nearest one to R (R is rounded where published)."""
        u, _, vt = np.linalg.svd(np.asarray(self.R))
        T = np.eye(4)
        T[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        T[:3, 3] = self.t
        return T


class Noise(_Strict):
    """IMU noise: m/s^2/sqrt(Hz), m/s^3/sqrt(Hz), rad/s/sqrt(Hz), rad/s^2/sqrt(Hz).

    `applied` false: shown only, the hosts keep their own.
    """

    acc: float
    acc_walk: float
    gyr: float
    gyr_walk: float
    applied: bool = True
    note: str = ""


class Device(_Strict):
    """A sensor payload; the first of `lidars` is the preferred form of the same LiDAR."""

    sensor: str
    lidars: list[Stream]
    lidar: LidarSource
    imu: ImuSource
    other_imus: list[ImuSource] = []
    T_imu_lidar: Extrinsic
    noise: Noise | None = None
    stamps: Literal["header", "log"] = "header"
    notes: list[str] = []

    def stream(self, topics: dict[str, str] | None = None) -> Stream:
        """The LiDAR topic a recording has (name to type), the preferred one if it has none."""
        there = [s for s in self.lidars if (topics or {}).get(s.topic) == s.type]
        return (there or self.lidars)[0]

    def remarks(self) -> list[str]:
        """What a user should know before running: rounded or guessed numbers, quirks."""
        pose, said = self.T_imu_lidar, list(self.notes)
        if not pose.exact:
            said.append(f"T_imu_lidar is no calibration of this payload: {pose.note}")
        if pose.rotation_error > ROUNDED:
            said.append(
                f"the published rotation is off SO(3) by {pose.rotation_error:.1e}; "
                "the nearest rotation is used"
            )
        if self.noise is not None and not self.noise.applied:
            said.append(f"published IMU noise not applied: {self.noise.note}")
        return said

    def source_config(self, name: str = "", topics: dict[str, str] | None = None) -> SourceConfig:
        """What `d2lio run` needs, with the LiDAR topic a recording has."""
        stream = self.stream(topics)
        changes: dict[str, Any] = {"topic": stream.topic}
        if not stream.type.endswith("PointCloud2"):
            changes["time_field"] = None
        lidar = self.lidar.model_copy(update=changes)
        return SourceConfig(
            name=name,
            T_imu_lidar=self.T_imu_lidar.matrix().tolist(),
            stamps=self.stamps,
            lidar=lidar,
            imu=self.imu,
            hosts={"liosam": self._noise(), "d2lio": self._noise()},
        )

    def _noise(self) -> dict[str, ParamValue]:
        if self.noise is None or not self.noise.applied:
            return {}
        return {
            "imuAccNoise": self.noise.acc,
            "imuGyrNoise": self.noise.gyr,
            "imuAccBiasN": self.noise.acc_walk,
            "imuGyrBiasN": self.noise.gyr_walk,
        }


class Pose(_Strict):
    """A rigid transform: unit quaternion w x y z, translation in m."""

    q_wxyz: list[float]
    t: list[float]

    def matrix(self) -> np.ndarray:
        """float64 [4, 4]."""
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat(self.q_wxyz, scalar_first=True).as_matrix()
        T[:3, 3] = self.t
        return T


class Truth(_Strict):
    """Ground truth of a kind: names of its files, format, body frame.

    `devices` are T_gt_device (p_gt = T p_device) by device; one that is not there is unknown.
    """

    files: list[str]
    format: Literal["tum", "csv_ns"]
    rate_hz: float
    body: str
    position_only: bool = False
    devices: dict[str, Pose] = {}
    notes: list[str] = []


class KnownSequence(_Strict):
    """A sequence; `tables` are the paper's it stands in."""

    name: str
    device: str
    truth: str | None = None
    aliases: list[str] = []
    duration_s: float | None = None
    length_m: float | None = None
    tables: str = ""

    @property
    def base(self) -> str:
        """The name without the device at its end; truth files are often shared by devices."""
        return re.sub(rf"_{self.device}$", "", self.name, flags=re.IGNORECASE)


class Pattern(_Strict):
    """Sequences known by the form of their names only."""

    regex: str
    device: str
    truth: str | None = None


class Dataset(_Strict):
    """One YAML file of `known/`; `name` is that of the file."""

    name: str
    title: str
    source: str
    folders: list[str]
    devices: dict[str, Device]
    truths: dict[str, Truth]
    sequences: list[KnownSequence]
    patterns: list[Pattern] = []


@lru_cache(maxsize=1)
def datasets() -> dict[str, Dataset]:
    """Every known data set by name."""
    found = {}
    for file in sorted(FOLDER.glob("*.yaml")):
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
        found[file.stem] = Dataset.model_validate({"name": file.stem, **data})
    return found


def _devices() -> dict[str, Device]:
    return {f"{d.name}/{k}": each for d in datasets().values() for k, each in d.devices.items()}


def device_named(name: str) -> Device | None:
    """The device named DATASET/DEVICE, None where there is none."""
    return _devices().get(name)


def device(name: str) -> Device:
    """As `device_named`.

    Raises:
        ConfigError: no such device; lists those that are known.
    """
    known = device_named(name)
    if known is None:
        raise ConfigError("device", name, ", ".join(_devices()))
    return known
