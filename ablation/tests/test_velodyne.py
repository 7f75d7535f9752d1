# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Velodyne packets: known points through an encoder of our own and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bags import IMU, Recorded, imu_message, ros1_store, write_bag
from d2lio.datasets import Scan, open_source, timed_events
from d2lio.datasets.events import NS_PER_S, Notes
from d2lio.datasets.velodyne import decode_velodyne_scan
from d2lio.errors import DataError
from packets import (
    HDL32E,
    SCAN_TYPE,
    VLP16,
    encode_packets,
    register,
    scan_bytes,
    scan_message,
    sweep,
)

STAMP = 1_517_157_000 * NS_PER_S + 250_000_000
GRID_M = 0.0011  # half of the 2 mm step, and single precision at 100 m
TIME_NS = 1
SENSORS = {"vlp16": VLP16, "hdl32e": HDL32E}


@pytest.mark.parametrize("cdr", [False, True])
@pytest.mark.parametrize("name", SENSORS)
def test_points_return_to_the_distance_grid(name: str, cdr: bool) -> None:
    sensor = SENSORS[name]
    known = sweep(sensor, packets=8, seed=1)
    packets = encode_packets(sensor, known, STAMP)
    scan = decode_velodyne_scan(scan_bytes(STAMP, packets, cdr=cdr), 7, cdr=cdr)
    seen = known.ranges.ravel() > 0.0
    assert (scan.stamp, scan.log_stamp) == (STAMP, 7)
    assert len(scan) == seen.sum()
    expected = known.xyz().reshape(-1, 3)[seen]
    error = np.linalg.norm(scan.xyz - expected, axis=1)
    assert error.max() < GRID_M
    np.testing.assert_allclose(scan.times, known.times_ns().ravel()[seen], atol=TIME_NS)
    np.testing.assert_array_equal(scan.ring, known.rings().ravel()[seen])
    np.testing.assert_array_equal(scan.intensity, known.reflectivity.ravel()[seen])


@pytest.mark.parametrize(("name", "lasers"), [("vlp16", 16), ("hdl32e", 32)])
def test_rings_count_up_with_the_elevation(name: str, lasers: int) -> None:
    sensor = SENSORS[name]
    packets = encode_packets(sensor, sweep(sensor, packets=2, seed=2), STAMP)
    scan = decode_velodyne_scan(scan_bytes(STAMP, packets), 0)
    height = np.arctan2(scan.xyz[:, 2], np.hypot(scan.xyz[:, 0], scan.xyz[:, 1]))
    centre = [np.rad2deg(np.median(height[scan.ring == ring])) for ring in range(lasers)]
    assert np.all(np.diff(centre) > 1.0)
    lowest, highest = (-15.0, 15.0) if lasers == 16 else (-92.0 / 3.0, 32.0 / 3.0)
    np.testing.assert_allclose(centre[0], lowest, atol=0.01)
    np.testing.assert_allclose(centre[-1], highest, atol=0.01)


def test_first_and_last_firing_of_a_vlp16_scan() -> None:
    known = sweep(VLP16, packets=76, seed=3, missing=0.0)
    scan = decode_velodyne_scan(scan_bytes(STAMP, encode_packets(VLP16, known, STAMP)), 0)
    assert scan.times[0] == 0
    # 76 packets of 24 firings; the last laser of the last firing.
    assert scan.times[-1] == pytest.approx(76 * 24 * 55_296 - 55_296 + 15 * 2_304, abs=76)
    assert np.all(np.diff(scan.times) > 0)


def test_azimuth_across_north_goes_on() -> None:
    known = sweep(VLP16, packets=3, seed=4, begin_deg=359.0)
    scan = decode_velodyne_scan(scan_bytes(STAMP, encode_packets(VLP16, known, STAMP)), 0)
    seen = known.ranges.ravel() > 0.0
    error = np.linalg.norm(scan.xyz - known.xyz().reshape(-1, 3)[seen], axis=1)
    assert error.max() < GRID_M


def test_bad_flags_azimuths_and_stamps_are_counted_and_left_out() -> None:
    known = sweep(VLP16, packets=4, seed=5, missing=0.0)
    packets = encode_packets(VLP16, known, STAMP)
    packets["data"]["blocks"]["flag"][0, 3] = 0xDDFF
    packets["data"]["blocks"]["azimuth"][1, 5] = 36_000
    packets["sec"][2] += 50
    notes = Notes()
    scan = decode_velodyne_scan(scan_bytes(STAMP, packets), 0, notes=notes)
    assert notes.counts == {"blocks_wrong_flag": 2, "packets_wrong_stamp": 1}
    assert len(scan) == (3 * 12 - 2) * 32
    kept = np.ones((4, 12, 32), bool)
    kept[0, 3] = kept[1, 5] = kept[2] = False
    error = np.linalg.norm(scan.xyz - known.xyz()[kept], axis=1)
    assert error.max() < GRID_M


def test_packets_of_wrong_size_are_counted() -> None:
    packets = encode_packets(VLP16, sweep(VLP16, packets=3, seed=6, missing=0.0), STAMP)
    notes = Notes()
    raw = scan_bytes(STAMP, packets, sizes=(1206, 1106, 1206))
    assert len(decode_velodyne_scan(raw, 0, notes=notes)) == 2 * 384
    assert notes.counts == {"packets_wrong_size": 1}


def test_packets_without_stamps_follow_each_other() -> None:
    known = sweep(VLP16, packets=3, seed=7, missing=0.0)
    packets = encode_packets(VLP16, known, STAMP)
    packets["sec"] = packets["nsec"] = 0
    scan = decode_velodyne_scan(scan_bytes(STAMP, packets), 0)
    np.testing.assert_allclose(scan.times, known.times_ns().ravel(), atol=2)


def test_of_two_returns_the_strongest_stays() -> None:
    known = sweep(VLP16, packets=2, seed=8, missing=0.0)
    packets = encode_packets(VLP16, known, STAMP, dual=True)
    notes = Notes()
    scan = decode_velodyne_scan(scan_bytes(STAMP, packets), 0, notes=notes)
    assert notes.counts == {"packets_dual_return": 2}
    kept = known.xyz()[:, :6].reshape(-1, 3)
    assert np.linalg.norm(scan.xyz - kept, axis=1).max() < GRID_M
    assert scan.times[384 // 2 - 1] == pytest.approx(known.times_ns()[0, 5, -1], abs=TIME_NS)


def test_last_return_decodes_like_the_strongest() -> None:
    packets = encode_packets(VLP16, sweep(VLP16, packets=1, seed=9), STAMP)
    strongest = decode_velodyne_scan(scan_bytes(STAMP, packets), 0)
    packets["data"]["mode"] = 0x38
    np.testing.assert_array_equal(
        decode_velodyne_scan(scan_bytes(STAMP, packets), 0).xyz, strongest.xyz
    )


def test_unknown_sensor_needs_a_name() -> None:
    packets = encode_packets(HDL32E, sweep(HDL32E, packets=1, seed=10), STAMP)
    expected = decode_velodyne_scan(scan_bytes(STAMP, packets), 0)
    packets["data"]["product"] = 0
    raw = scan_bytes(STAMP, packets)
    with pytest.raises(DataError, match="product byte 0x00"):
        decode_velodyne_scan(raw, 0)
    named = decode_velodyne_scan(raw, 0, model="hdl32e")
    np.testing.assert_array_equal(named.xyz, expected.xyz)


def test_scan_without_packets_or_returns_is_empty() -> None:
    packets = encode_packets(VLP16, sweep(VLP16, packets=2, seed=11, missing=1.0), STAMP)
    for some in (packets[:0], packets):
        scan = decode_velodyne_scan(scan_bytes(STAMP, some), 0)
        assert scan.xyz.shape == (0, 3)
        assert scan.times is not None
        assert len(scan.times) == 0


@pytest.mark.parametrize("cdr", [False, True])
def test_truncated_scan_is_refused(cdr: bool) -> None:
    packets = encode_packets(VLP16, sweep(VLP16, packets=2, seed=12), STAMP)
    raw = scan_bytes(STAMP, packets, cdr=cdr)
    for end in (len(raw) - 100, 30, 10):
        with pytest.raises(DataError, match=r"truncated|claims 2 packets"):
            decode_velodyne_scan(raw[:end], 0, cdr=cdr)


def test_bag_of_packets_with_header_stamps_far_from_the_recorders(tmp_path: Path) -> None:
    """As SubT-MRS has it: the recorder's clock is years ahead, the headers' one counts."""
    store = register(ros1_store())
    period, shift = NS_PER_S // 10, 172_000_000 * NS_PER_S
    messages = []
    for index in range(-20, 60):
        stamp = STAMP + index * NS_PER_S // 200
        messages.append(Recorded(stamp + shift, "/imu/data", IMU, imu_message(store, stamp)))
    for index in range(3):
        stamp = STAMP + index * period
        packets = encode_packets(VLP16, sweep(VLP16, packets=75, seed=index), stamp)
        message = scan_message(store, stamp, packets)
        log = stamp + period + shift
        messages.append(Recorded(log, "/velodyne_packets", SCAN_TYPE, message))
    messages.sort(key=lambda m: m.log)
    source = open_source(write_bag(tmp_path / "raw_data_0.bag", messages, store))
    scans = [e for e in timed_events(source.reader) if isinstance(e, Scan)]
    assert len(scans) == 3
    for index, scan in enumerate(scans):
        known = sweep(VLP16, packets=75, seed=index)
        expected = known.times_ns().ravel()[known.ranges.ravel() > 0.0] + index * period
        # The first channels may be without a return: a scan begins with its first point.
        np.testing.assert_allclose(scan.stamp - STAMP + scan.dt_ns, expected, atol=TIME_NS)
    assert any("start" in message for message in source.reader.notes.messages)
