# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A drive of KITTI raw, converted: scans/*.npz, oxts.csv, gt_imu_tum.txt.

The scans are motion compensated by their publisher and only 10 Hz of the OXTS unit were kept, so
a 100 Hz IMU is rebuilt: attitude from roll, pitch, yaw; specific force from forward acceleration,
centripetal acceleration and gravity. It is as smooth as its source: no vibration, no bias.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from d2lio.datasets.events import NS_PER_S, ImuBlock, Notes, RawEvent, RawScan, TimeHint
from d2lio.errors import DataError

IMU_RATE_HZ = 100
RINGS = 64  # of the HDL-64E
GRAVITY = 9.81  # m/s^2
LEAD_S = 0.3  # IMU samples before the first and after the last scan

# KITTI calibration of 2011_09_26, p_velo = R p_imu + t.
_R_VELO_IMU = np.array(
    [
        [9.999976e-01, 7.553071e-04, -2.035826e-03],
        [-7.854027e-04, 9.998898e-01, -1.482298e-02],
        [2.024406e-03, 1.482454e-02, 9.998881e-01],
    ]
)
_T_VELO_IMU = np.array([-8.086759e-01, 3.195559e-01, -7.997231e-01])  # m


def extrinsic() -> np.ndarray:
    """T_imu_lidar, float64 [4, 4], the inverse of KITTI's calib_imu_to_velo."""
    pose = np.eye(4)
    pose[:3, :3] = _R_VELO_IMU.T
    pose[:3, 3] = -_R_VELO_IMU.T @ _T_VELO_IMU
    return pose


@dataclass(frozen=True, slots=True)
class Oxts:
    """One row per scan: stamps ns [N]; attitude rad [N, 3]; v m/s, a m/s^2, yaw rate rad/s [N]."""

    stamps: np.ndarray
    roll_pitch_yaw: np.ndarray
    forward_velocity: np.ndarray
    forward_accel: np.ndarray
    yaw_rate: np.ndarray


_COLUMNS = ("timestamp", "roll_rad", "pitch_rad", "yaw_rad", "vf_mps", "af_mps2", "wz_degps")


def read_oxts(file: Path) -> Oxts:
    """Reads oxts.csv.

    Raises:
        DataError: missing file or column, or a cell that is not a number.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            header = [name.strip(" #") for name in next(stream, "").strip().split(",")]
            rows = list(csv.DictReader(stream, fieldnames=header))
    except OSError as err:
        raise DataError(f"{file}: {err.strerror}") from None
    missing = [name for name in _COLUMNS if name not in header]
    if missing or len(rows) < 4:
        raise DataError(f"{file}: {f'no column {missing[0]}' if missing else 'too few rows'}")
    try:
        stamps = np.array([_nanoseconds(row["timestamp"]) for row in rows], np.int64)
        table = np.array([[float(row[name]) for name in _COLUMNS[1:]] for row in rows])
    except (TypeError, ValueError) as err:
        raise DataError(f"{file}: {err}") from None
    return Oxts(stamps, table[:, :3], table[:, 3], table[:, 4], np.deg2rad(table[:, 5]))


def _nanoseconds(text: str) -> int:
    whole, _, fraction = text.strip().partition(".")
    return int(whole) * NS_PER_S + int(fraction.ljust(9, "0")[:9])


def rebuild_imu(oxts: Oxts, rate_hz: int = IMU_RATE_HZ, *, orientation: bool = False) -> ImuBlock:
    """IMU samples from LEAD_S before the first scan to LEAD_S after the last.

    Angular rate: roll and pitch rates from a spline through the attitudes, yaw rate as measured.
    Specific force f = R^T(a + g e_z) with a = (dv/dt, v w_z, 0) in the level frame. Beyond the
    ends the attitude turns on at the rates of the end (no extrapolated polynomials).
    """
    t = (oxts.stamps - oxts.stamps[0]) / NS_PER_S
    step = NS_PER_S // rate_hz
    first = oxts.stamps[0] - int(LEAD_S * NS_PER_S)
    stamps = np.arange(first, oxts.stamps[-1] + int(LEAD_S * NS_PER_S) + 1, step, dtype=np.int64)
    query = (stamps - oxts.stamps[0]) / NS_PER_S
    inside = np.clip(query, t[0], t[-1])
    angles = np.unwrap(oxts.roll_pitch_yaw, axis=0)
    roll, pitch = CubicSpline(t, angles[:, :2])(inside).T
    roll_rate, pitch_rate = CubicSpline(t, angles[:, :2])(inside, 1).T
    yaw_rate = PchipInterpolator(t, oxts.yaw_rate)(inside)
    speed = PchipInterpolator(t, oxts.forward_velocity)(inside)
    forward = PchipInterpolator(t, oxts.forward_accel)(inside)
    gyro = np.stack(
        [roll_rate - np.sin(pitch) * yaw_rate, np.cos(roll) * pitch_rate, yaw_rate], axis=1
    )
    level = np.stack([forward, speed * yaw_rate, np.full_like(speed, GRAVITY)], axis=1)
    tilt = Rotation.from_euler("ZYX", np.stack([np.zeros_like(roll), pitch, roll], axis=1))
    attitude = None
    if orientation:
        yaw = CubicSpline(t, angles[:, 2])(inside)
        attitude = (Rotation.from_euler("Z", yaw[:, None]) * tilt).as_quat()
    return ImuBlock(stamps, gyro, tilt.inv().apply(level), attitude)


class KittiReader:
    """Reads the directory; opening checks that scans and oxts.csv belong together.

    Args:
        path: the directory.
        orientation: give the attitude of the OXTS unit, which the ground truth comes from as well.

    Raises:
        DataError: files missing or of different number.
    """

    def __init__(self, path: Path, *, orientation: bool = False) -> None:
        self._path = path
        self._orientation = orientation
        self.notes = Notes()
        self.time_hint = TimeHint(synchronised=True)
        self._oxts = read_oxts(path / "oxts.csv")
        self._scans = sorted((path / "scans").glob("*.npz"))
        if len(self._scans) != len(self._oxts.stamps):
            raise DataError(
                f"{path}: {len(self._scans)} scans but {len(self._oxts.stamps)} rows in oxts.csv"
            )
        self.notes.tell("KITTI: 100 Hz IMU rebuilt from 10 Hz of OXTS; scans motion compensated")

    @property
    def scan_total(self) -> int | None:
        """Number of scans."""
        return len(self._scans)

    @property
    def inputs(self) -> list[str]:
        """Names of the files read."""
        return ["oxts.csv", *(f"scans/{file.name}" for file in self._scans)]

    def raw_events(self) -> Iterator[RawEvent]:
        """Events in order of time; see `Reader`."""
        imu = rebuild_imu(self._oxts, orientation=self._orientation)
        begin = 0
        for stamp, file in zip(self._oxts.stamps.tolist(), self._scans, strict=True):
            end = int(np.searchsorted(imu.stamps, stamp, side="right"))
            yield _part(imu, begin, end)
            begin = end
            yield self._scan(file, stamp)
        yield _part(imu, begin, len(imu))

    def _scan(self, file: Path, stamp: int) -> RawScan:
        self.notes.count("scans_read")
        try:
            with np.load(file) as data:
                xyz = np.ascontiguousarray(data["xyz"], np.float32)
                intensity = data["intensity"].astype(np.float32)
        except (OSError, KeyError, ValueError) as err:
            raise DataError(f"{file}: cannot be read: {err}") from None
        ring = rings_by_turns(xyz)
        if ring is None:
            self.notes.tell(f"{file.name}: the points do not come ring by ring; they get no rings")
        return RawScan(stamp, stamp, xyz, None, intensity, ring)


def rings_by_turns(xyz: np.ndarray) -> np.ndarray | None:
    """Ring of every point of a KITTI scan, which its file does not hold.

    The points come ring by ring from the top one down, each counter-clockwise from straight ahead:
    the azimuth in [0, 2 pi) falls back once between rings. Elevation would not do: the lasers of
    an HDL-64E are spaced unevenly, and the published points are corrected for their offsets.

    Args:
        xyz: float32 [N, 3], LiDAR frame, in the order of the file.

    Returns:
        uint16 [N], 0 the lowest; None where more turns than rings are found.
    """
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0]) % (2.0 * np.pi)
    turns = np.concatenate([[0], np.cumsum(np.diff(azimuth) < -np.pi)])
    if turns[-1] >= RINGS:
        return None
    return (RINGS - 1 - turns).astype(np.uint16)


def _part(imu: ImuBlock, begin: int, end: int) -> ImuBlock:
    attitude = None if imu.orientation is None else imu.orientation[begin:end]
    return ImuBlock(imu.stamps[begin:end], imu.gyro[begin:end], imu.accel[begin:end], attitude)
