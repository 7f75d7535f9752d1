# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What a source needs to be known: topics, times, ranges, extrinsic (`d2lio run --config`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from d2lio.datasets.events import TimeHint
from d2lio.errors import ConfigError, DataError
from d2lio.sequence import RigidRows, Sequence

IDENTITY = [[float(i == j) for j in range(4)] for i in range(4)]


ParamValue = str | float | int | bool | list[float]
HostName = Literal["fastlio", "liosam", "d2lio"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", protected_namespaces=())


class LidarSource(_Strict):
    """LiDAR stream. `topic` and `time_field` may be left out where only one fits.

    `columns` are firings of a ring in a turn (Livox: points of a line in a scan), 0 those of the
    model; only LIO-SAM's range image needs them.
    """

    topic: str | None = None
    model: str = ""
    rings: Annotated[int, Field(ge=0, le=1024)] = 0  # 0: unknown
    columns: Annotated[int, Field(ge=0, le=16384)] = 0
    rate_hz: Annotated[float, Field(gt=0.0)] = 10.0
    min_range_m: Annotated[float, Field(ge=0.0)] = 0.5
    max_range_m: Annotated[float, Field(gt=0.0)] = 100.0
    time_field: str | None = None
    time_unit: Literal["auto", "s", "ms", "us", "ns"] = "auto"
    time_reference: Literal["auto", "start", "end", "absolute"] = "auto"
    synchronised: bool = False
    pseudo_times: bool = False


class ImuSource(_Strict):
    """IMU stream; `accel_unit` g multiplies the accelerations by 9.80665 m/s^2.

    `orientation`: whether the orientation of a 9-axis IMU is handed on; unset is yes for bags whose
    messages have one, and no for KITTI, where it comes from the ground truth's unit.
    """

    topic: str | None = None
    rate_hz: Annotated[float, Field(gt=0.0)] = 200.0
    accel_unit: Literal["m/s^2", "g"] = "m/s^2"
    orientation: bool | None = None


class SourceConfig(_Strict):
    """A source and the host parameters that suit it.

    Attributes:
        name: used for the default output directory.
        T_imu_lidar: 4x4 by rows, maps LiDAR points to the IMU frame, m.
        stamps: header, or log (times of reception, for sources whose clocks differ).
        ground_truth: TUM file, relative to the configuration file.
        host: host parameters by key, for whatever host, applied before `--set`.
        hosts: host parameters by host and key, applied after `host`.
    """

    name: str = ""
    T_imu_lidar: RigidRows = IDENTITY
    stamps: Literal["header", "log"] = "header"
    ground_truth: str | None = None
    lidar: LidarSource = LidarSource()
    imu: ImuSource = ImuSource()
    host: dict[str, ParamValue] = {}
    hosts: dict[HostName, dict[str, ParamValue]] = {}

    @property
    def extrinsic(self) -> np.ndarray:
        """T_imu_lidar, float64 [4, 4]."""
        return np.asarray(self.T_imu_lidar, dtype=float)

    def time_hint(self) -> TimeHint:
        """What is known about the point times."""
        return TimeHint(
            unit=self.lidar.time_unit,
            reference=self.lidar.time_reference,
            period_s=1.0 / self.lidar.rate_hz,
            synchronised=self.lidar.synchronised,
            pseudo=self.lidar.pseudo_times,
        )

    @classmethod
    def parse(cls, data: object, where: str = "") -> SourceConfig:
        """Validates nested mappings.

        Raises:
            ConfigError: names the first bad key.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as err:
            raise config_error(err, where) from None

    @classmethod
    def load(cls, file: Path) -> SourceConfig:
        """Reads a YAML file.

        Raises:
            DataError: unreadable; ConfigError: a bad key.
        """
        try:
            data = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as err:
            raise DataError(f"{file}: cannot be read: {' '.join(str(err).split())}") from None
        return cls.parse(data, str(file))

    @classmethod
    def from_sequence(cls, sequence: Sequence) -> SourceConfig:
        """The same facts out of a sequence.yaml."""
        lidar, imu = sequence.lidar, sequence.imu
        return cls(
            name=sequence.name,
            T_imu_lidar=sequence.T_imu_lidar,
            ground_truth=sequence.ground_truth,
            lidar=LidarSource(
                topic=lidar.topic,
                model=lidar.model,
                rings=lidar.rings,
                rate_hz=lidar.rate_hz,
                min_range_m=lidar.min_range_m,
                max_range_m=lidar.max_range_m,
                time_field=lidar.time_field,
                time_unit=lidar.time_unit if lidar.time_field else "auto",
                synchronised=lidar.synchronised or lidar.time_field is None,
            ),
            imu=ImuSource(topic=imu.topic, rate_hz=imu.rate_hz),
        )


def config_error(error: ValidationError, where: str) -> ConfigError:
    """The first complaint of pydantic, unknown keys before the rest."""
    details = sorted(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    first = details[0]
    key = ".".join(str(part) for part in first["loc"]) or "configuration"
    allowed = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        allowed = "no such key"
    text = repr(first["input"])
    return ConfigError(key, text if len(text) <= 80 else text[:77] + "...", allowed, where)
