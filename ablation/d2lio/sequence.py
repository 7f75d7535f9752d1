# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The ``sequence.yaml`` that describes one recorded or simulated sequence."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    model_validator,
)

from d2lio.strict_yaml import first_complaint, read_yaml

FILE_NAME = "sequence.yaml"
ROTATION_TOLERANCE = 1e-3  # calibration files round rotations to four decimals or so

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]


def _rigid(rows: list[list[float]]) -> list[list[float]]:
    matrix = np.asarray(rows, dtype=float)
    if not np.isfinite(matrix).all() or not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("finite numbers and a last row of 0 0 0 1")
    rotation = matrix[:3, :3]
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    determinant = float(np.linalg.det(rotation))
    if error > ROTATION_TOLERANCE or determinant < 0.0:
        raise ValueError(f"a rotation in SO(3); this one has determinant {determinant:.6g}")
    return rows


# A rigid transform, 4x4 by rows; a rotation that is none is refused with its determinant.
RigidRows = Annotated[list[Row], Field(min_length=4, max_length=4), AfterValidator(_rigid)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=False, protected_namespaces=())


class LidarInfo(_Strict):
    """The lidar stream. Ranges in metres, ``time_unit`` is the unit of ``time_field``.

    ``time_field`` is null where the points carry no time of their own. ``synchronised``: the points
    are motion compensated to the stamp already, whatever their times say.
    """

    topic: Text
    model: Text
    rings: Annotated[int, Field(ge=1, le=1024)]
    rate_hz: Positive
    min_range_m: NonNegative
    max_range_m: Positive
    time_field: Text | None
    time_unit: Literal["s", "ms", "us", "ns"]
    synchronised: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> LidarInfo:
        if self.min_range_m >= self.max_range_m:
            raise ValueError("min_range_m must be below max_range_m")
        return self


class ImuInfo(_Strict):
    """The IMU stream.

    ``gyro_noise`` rad/s/√Hz, ``accel_noise`` m/s²/√Hz, ``gyro_walk`` rad/s²/√Hz,
    ``accel_walk`` m/s³/√Hz.
    """

    topic: Text
    rate_hz: Positive
    gyro_noise: Positive
    accel_noise: Positive
    gyro_walk: NonNegative
    accel_walk: NonNegative


class Sequence(_Strict):
    """One sequence: a bag, its ground truth (T_world_imu, TUM), extrinsic and sensors.

    ``bag`` and ``ground_truth`` are relative to the directory of the file;
    ``ground_truth`` is null where there is none. ``T_imu_lidar`` is 4×4, by rows.
    """

    name: Text
    bag: Text
    ground_truth: Text | None
    T_imu_lidar: RigidRows
    lidar: LidarInfo
    imu: ImuInfo
    _root: Path = PrivateAttr(default=Path("."))

    @classmethod
    def load(cls, directory: Path | str) -> Sequence:
        """Read ``sequence.yaml`` in ``directory``.

        Raises:
            DataError: the file is missing or is not YAML.
            ConfigError: a key is unknown, missing or out of range; names file and key.
        """
        root = Path(directory)
        file = root / FILE_NAME
        sequence = cls.parse(read_yaml(file), where=str(file))
        sequence._root = root
        return sequence

    @classmethod
    def parse(cls, data: object, where: str = "") -> Sequence:
        """Validate ``data`` (nested mappings); raises ConfigError naming the first bad key."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise first_complaint(error, where, FILE_NAME, _known_keys, _plain) from None

    def save(self, directory: Path | str) -> Path:
        """Write ``sequence.yaml`` into ``directory`` and return its path."""
        file = Path(directory) / FILE_NAME
        data = self.model_dump(exclude_defaults=True)
        text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None)
        file.write_text(text, encoding="utf-8")
        self._root = file.parent
        return file

    @property
    def root(self) -> Path:
        """Directory the relative paths start from."""
        return self._root

    @property
    def bag_path(self) -> Path:
        """Path of the bag."""
        return self._root / self.bag

    @property
    def ground_truth_path(self) -> Path | None:
        """Path of the ground truth, or None."""
        return None if self.ground_truth is None else self._root / self.ground_truth

    @property
    def extrinsic(self) -> np.ndarray:
        """T_imu_lidar as a 4×4 float64 array."""
        return np.asarray(self.T_imu_lidar, dtype=float)


def _known_keys(location: tuple[int | str, ...]) -> str:
    section = {"lidar": LidarInfo, "imu": ImuInfo}.get(str(location[0]), Sequence)
    if len(location) == 1:
        section = Sequence
    return ", ".join(section.model_fields)


def _plain(value: object) -> object:
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
