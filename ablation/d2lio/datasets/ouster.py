# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Ouster captures (.pcap with the sensor's .json) through ouster-sdk, an optional extra.

Every point carries the time of its column as the sensor measured it, and the IMU samples the time
of the accelerometer, both of one clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from d2lio.datasets.config import ImuSource, LidarSource, SourceConfig
from d2lio.datasets.events import Notes, RawEvent, RawScan, TimeHint
from d2lio.datasets.ordering import ImuMessage, gather
from d2lio.errors import DataError

STANDARD_GRAVITY = 9.80665  # m/s^2 per g, the unit of the sensor's accelerations
MIN_COMMON_PREFIX = 6  # characters a capture shares with its metadata
IMU_RATE_HZ = 100.0


def _sdk() -> tuple[Any, Any]:
    try:
        from ouster.sdk import core, pcap
    except ImportError as err:
        raise DataError(
            f"Ouster captures need ouster-sdk 1.0 or later ({err}): "
            "pip install --no-deps ouster-sdk more-itertools"
        ) from None
    return core, pcap


def find_metadata(capture: Path) -> Path:
    """The sensor's metadata: the .json of the same stem, or that with the longest common prefix.

    Raises:
        DataError: none shares the beginning of the capture's name.
    """
    candidates = sorted(capture.parent.glob("*.json"))

    def common(file: Path) -> int:
        pairs = zip(file.stem, capture.stem, strict=False)
        return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))

    best = max(candidates, key=lambda f: (common(f), -len(f.stem)), default=None)
    if best is None or common(best) < MIN_COMMON_PREFIX:
        names = ", ".join(f.name for f in candidates) or "none"
        raise DataError(f"{capture}: no metadata .json beside it (found: {names})")
    return best


class OusterReader:
    """Reads a capture; the metadata gives the extrinsic and the rate.

    Raises:
        DataError: ouster-sdk is missing, or the capture or its metadata is unreadable.
    """

    def __init__(self, path: Path) -> None:
        self._core, self._pcap = _sdk()
        self._path = path
        self.notes = Notes()
        self._metadata = find_metadata(path)
        try:
            self._info = self._core.SensorInfo(self._metadata.read_text(encoding="utf-8"))
        except (OSError, RuntimeError, ValueError) as err:
            raise DataError(f"{self._metadata}: cannot be read: {err}") from None
        self.config = self._describe()
        self.time_hint: TimeHint = self.config.time_hint()

    @property
    def scan_total(self) -> int | None:
        """Unknown before the capture is read."""
        return None

    @property
    def inputs(self) -> list[str]:
        """Names of the files read."""
        return [self._path.name, self._metadata.name]

    def _describe(self) -> SourceConfig:
        # imu_to_sensor maps IMU points to the sensor frame, in millimetres.
        imu_to_sensor = np.array(self._info.imu_to_sensor_transform, np.float64)
        imu_to_sensor[:3, 3] *= 1e-3
        lidar = LidarSource(
            model=str(self._info.prod_line),
            rings=self._info.h,
            columns=self._info.w,
            rate_hz=float(self._info.format.fps) or 10.0,
            min_range_m=0.5,
            max_range_m=120.0,
            time_unit="ns",
            time_reference="start",
        )
        return SourceConfig(
            name=self._path.stem,
            T_imu_lidar=np.linalg.inv(imu_to_sensor).tolist(),
            lidar=lidar,
            imu=ImuSource(rate_hz=IMU_RATE_HZ),
        )

    def raw_events(self) -> Iterator[RawEvent]:
        """Events in order of arrival; see `Reader`."""
        try:
            yield from gather(self._messages(), self.notes)
        except (RuntimeError, OSError) as err:
            if isinstance(err, DataError):
                raise
            raise DataError(f"{self._path}: cannot be read: {err}") from None

    def _messages(self) -> Iterator[ImuMessage | RawScan]:
        core, info = self._core, self._info
        to_xyz = core.XYZLut(info, False)  # False: the sensor frame, not a vehicle's
        batch, frame = core.FrameBatcher(info), core.LidarFrame(info)
        source = self._pcap.PcapPacketSource(str(self._path), sensor_info=[info])
        for _, packet in source:
            if isinstance(packet, core.ImuPacket):
                self.notes.count("imu_read")
                yield _imu(packet)
            elif isinstance(packet, core.LidarPacket) and batch.batch(packet, frame):
                yield from self._scan(frame, to_xyz, packet.host_timestamp)
                frame = core.LidarFrame(info)

    def _scan(self, frame: Any, to_xyz: Any, log_stamp: int) -> Iterator[RawScan]:
        self.notes.count("scans_read")
        ranges = np.asarray(frame.field(self._core.ChanField.RANGE))
        columns = np.asarray(frame.timestamp, np.int64)
        seen = (ranges > 0) & (columns > 0)
        missing = int((columns == 0).sum())
        if missing:
            self.notes.count("columns_missing", missing)
        if not seen.any():
            self.notes.count("scans_empty")
            return
        order = seen.T  # column by column, as the sensor fires
        stamp = int(columns[columns > 0].min())
        times = np.broadcast_to(columns, ranges.shape).T[order] - stamp
        rings = np.broadcast_to(np.arange(len(ranges))[:, None], ranges.shape).T[order]
        yield RawScan(
            stamp=stamp,
            log_stamp=int(log_stamp),
            xyz=np.ascontiguousarray(np.asarray(to_xyz(frame)).transpose(1, 0, 2)[order], "f4"),
            times=times,
            intensity=_intensity(frame, self._core).T[order].astype(np.float32),
            ring=rings.astype(np.uint16),
        )


def _intensity(frame: Any, core: Any) -> np.ndarray:
    for name in (core.ChanField.SIGNAL, core.ChanField.REFLECTIVITY):
        if name in frame.fields:
            return np.asarray(frame.field(name))
    return np.zeros((frame.h, frame.w), np.float32)


def _imu(packet: Any) -> ImuMessage:
    layout, buffer = packet.format, packet.buf
    gyro = np.deg2rad(
        [layout.imu_av_x(buffer), layout.imu_av_y(buffer), layout.imu_av_z(buffer)]
    ).tolist()
    accel = [layout.imu_la_x(buffer), layout.imu_la_y(buffer), layout.imu_la_z(buffer)]
    values = (*gyro, *(STANDARD_GRAVITY * value for value in accel))
    return ImuMessage(int(layout.imu_accel_ts(buffer)), int(packet.host_timestamp), values)
