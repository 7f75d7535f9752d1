# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Real Ouster captures: points, column times and IMU against an independent conversion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from d2lio.datasets import ImuBlock, RawScan, open_source, timed_events
from d2lio.datasets.ouster import find_metadata
from d2lio.errors import DataError

CAPTURES = {
    "OS-1-128_v2.3.0_1024x10_lb_n3": 3,
    "OS-0-128-U1_v2.3.0_1024x10": 1,
    "OS-2-128-U1_v2.3.0_1024x10": 1,
}
XYZ_TOLERANCE_M = 1e-3  # float32 at 240 m, through two conversions


def needs_sdk() -> None:
    pytest.importorskip("ouster.sdk.pcap", reason="ouster-sdk is not installed (an extra)")


@pytest.mark.parametrize("name", CAPTURES)
def test_points_and_times_are_the_sensors_own(name: str, real_data) -> None:
    needs_sdk()
    capture = real_data(f"ouster_sdk_tests/pcaps/{name}.pcap")
    known = np.load(real_data(f"ouster_sdk_tests/npz/{name}.npz"))
    events = list(open_source(capture).reader.raw_events())
    scans = [event for event in events if isinstance(event, RawScan)]
    assert len(scans) == CAPTURES[name]
    for index, scan in enumerate(scans):
        of_frame = known["frame"] == index
        stamps = scan.stamp + scan.times
        mine = np.lexsort((scan.ring, stamps))
        theirs = np.lexsort((known["ring"][of_frame], known["t_ns"][of_frame]))
        np.testing.assert_array_equal(stamps[mine], known["t_ns"][of_frame][theirs])
        np.testing.assert_array_equal(scan.ring[mine], known["ring"][of_frame][theirs])
        np.testing.assert_allclose(
            scan.xyz[mine], known["xyz"][of_frame][theirs], atol=XYZ_TOLERANCE_M
        )
        assert np.all(np.diff(scan.times) >= 0)  # column by column


def test_imu_in_si_units_on_the_same_clock(real_data) -> None:
    needs_sdk()
    name = "OS-1-128_v2.3.0_1024x10_lb_n3"
    source = open_source(real_data(f"ouster_sdk_tests/pcaps/{name}.pcap"))
    known = np.load(real_data(f"ouster_sdk_tests/npz/{name}.npz"))
    events = list(timed_events(source.reader))
    blocks = [event for event in events if isinstance(event, ImuBlock)]
    np.testing.assert_array_equal(
        np.concatenate([b.stamps for b in blocks]), known["imu_raw_ts_ns"][:, 1]
    )
    np.testing.assert_allclose(
        np.concatenate([b.accel for b in blocks]), known["imu"][:, 1:4], rtol=1e-5
    )
    np.testing.assert_allclose(
        np.concatenate([b.gyro for b in blocks]), known["imu"][:, 4:], rtol=1e-5
    )
    scans = [event for event in events if not isinstance(event, ImuBlock)]
    assert len(scans) == 3
    assert all(0.09e9 < scan.dt_ns.max() < 0.101e9 for scan in scans)
    expected = np.linalg.inv(known["imu_to_sensor"])
    np.testing.assert_allclose(source.config.extrinsic[:3, :3], expected[:3, :3], atol=1e-9)
    np.testing.assert_allclose(source.config.extrinsic[:3, 3], expected[:3, 3] * 1e-3, atol=1e-9)


def test_metadata_by_common_beginning(tmp_path: Path) -> None:
    capture = tmp_path / "OS-1-128_v2_drive.pcap"
    for name in ("OS-1-128_v2.json", "OS-0-32.json", "other.json"):
        (tmp_path / name).touch()
    assert find_metadata(capture).name == "OS-1-128_v2.json"
    with pytest.raises(DataError, match=r"found: OS-0-32\.json, OS-1-128_v2\.json, other\.json"):
        find_metadata(tmp_path / "capture.pcap")


def test_bad_capture(tmp_path: Path) -> None:
    needs_sdk()
    (tmp_path / "a_sensor.pcap").write_bytes(b"not a capture")
    (tmp_path / "a_sensor.json").write_text("{}")
    with pytest.raises(DataError, match="a_sensor"):
        list(open_source(tmp_path / "a_sensor.pcap").reader.raw_events())
