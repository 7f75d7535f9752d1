# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Point times through the core's resolver, scan after scan."""

from __future__ import annotations

import numpy as np
import pytest
from d2lio.datasets.events import Notes, RawScan, TimeHint
from d2lio.datasets.timing import BAD_SCANS_IN_A_ROW, TimeResolver, scan_end, seconds
from d2lio.errors import DataError

NS = 1_000_000_000
STAMP = 1_700_000_000 * NS + 987_654_321
COUNT = 1000
SPAN_NS = 99_900_000
TOLERANCE_F32_NS = 10  # float32 seconds below 0.1 s resolve 7.5 ns


def raw(times: np.ndarray | None, stamp: int = STAMP) -> RawScan:
    rng = np.random.default_rng(1)
    xyz = rng.normal(0.0, 10.0, (COUNT, 3)).astype(np.float32)
    return RawScan(stamp, stamp + NS // 10, xyz, times)


OFFSETS = np.linspace(0, SPAN_NS, COUNT).astype(np.int64)

FORMS = {
    "velodyne: float32 s from the start": ((OFFSETS * 1e-9).astype(np.float32), 0),
    "ouster: uint32 ns from the start": (OFFSETS.astype(np.uint32), 0),
    "livox: uint32 ns": (OFFSETS.astype(np.uint32), 0),
    "us": ((OFFSETS / 1000).astype(np.float32), 0),
    "GEODE: float32 s, the stamp at the end": (((OFFSETS - SPAN_NS) * 1e-9).astype("f4"), -SPAN_NS),
    "absolute uint64 ns": ((STAMP + OFFSETS).astype(np.uint64), 0),
}


@pytest.mark.parametrize("name", FORMS)
def test_every_convention_gives_the_same_offsets(name: str) -> None:
    times, start = FORMS[name]
    notes = Notes()
    scan = TimeResolver(TimeHint(), notes).resolve(raw(times))
    assert scan is not None
    assert scan.stamp == pytest.approx(STAMP + start, abs=TOLERANCE_F32_NS)
    np.testing.assert_allclose(scan.dt_ns, OFFSETS, atol=TOLERANCE_F32_NS)
    assert scan.dt_ns.dtype == np.int32
    assert len(notes.messages) == 1


def test_absolute_double_seconds_keep_what_doubles_hold() -> None:
    times = (STAMP + OFFSETS) * 1e-9
    scan = TimeResolver(TimeHint(), Notes()).resolve(raw(times))
    assert scan is not None
    np.testing.assert_allclose(scan.dt_ns + (scan.stamp - STAMP), OFFSETS, atol=500)


def test_unsorted_points_keep_their_own_times() -> None:
    order = np.random.default_rng(2).permutation(COUNT)
    scan = TimeResolver(TimeHint(), Notes()).resolve(raw(OFFSETS[order].astype(np.uint32)))
    assert scan is not None
    np.testing.assert_array_equal(scan.dt_ns, OFFSETS[order])
    assert scan_end(scan) == STAMP + SPAN_NS


def test_synchronised_scans_have_no_offsets() -> None:
    scan = TimeResolver(TimeHint(synchronised=True), Notes()).resolve(raw(None))
    assert scan is not None
    assert scan.stamp == STAMP
    assert not scan.dt_ns.any()


def test_absent_times_are_refused_with_a_remedy() -> None:
    with pytest.raises(DataError, match="pseudo_times"):
        TimeResolver(TimeHint(), Notes()).resolve(raw(None))


def test_pseudo_times_only_when_asked() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, COUNT, endpoint=False)
    xyz = np.stack([10 * np.cos(-angle), 10 * np.sin(-angle), 0 * angle], 1).astype(np.float32)
    scan_without = RawScan(STAMP, STAMP, xyz, None)
    with pytest.raises(DataError):
        TimeResolver(TimeHint(), Notes()).resolve(scan_without)
    notes = Notes()
    scan = TimeResolver(TimeHint(pseudo=True), notes).resolve(scan_without)
    assert scan is not None
    np.testing.assert_allclose(scan.dt_ns, angle / (2 * np.pi) * 1e8, atol=1e6)
    assert "azimuth" in notes.messages[0]


def test_all_equal_times_are_dropped_then_refused() -> None:
    notes = Notes()
    resolver = TimeResolver(TimeHint(), notes)
    equal = raw(np.zeros(COUNT, np.float32))
    for _ in range(BAD_SCANS_IN_A_ROW - 1):
        assert resolver.resolve(equal) is None
    assert notes.counts == {"scans_bad_times_all_equal": BAD_SCANS_IN_A_ROW - 1}
    with pytest.raises(DataError):
        resolver.resolve(equal)


def test_a_bad_scan_amid_good_ones_is_only_counted() -> None:
    notes = Notes()
    resolver = TimeResolver(TimeHint(), notes)
    good = (OFFSETS * 1e-9).astype(np.float32)
    assert resolver.resolve(raw(good)) is not None
    bad = np.full(COUNT, np.nan, np.float32)
    for _ in range(BAD_SCANS_IN_A_ROW + 5):
        assert resolver.resolve(raw(bad)) is None
    assert resolver.resolve(raw(good)) is not None
    assert notes.counts == {"scans_bad_times_not_finite": BAD_SCANS_IN_A_ROW + 5}


def test_convention_of_the_first_scan_holds_for_tiny_ones() -> None:
    resolver = TimeResolver(TimeHint(), Notes())
    resolver.resolve(raw(OFFSETS.astype(np.uint32)))
    tiny = RawScan(STAMP, STAMP, np.ones((2, 3), np.float32), np.array([5, 1000], np.uint32))
    scan = resolver.resolve(tiny)
    assert scan is not None
    assert (scan.dt_ns + (scan.stamp - STAMP)).tolist() == [5, 1000]


def test_empty_scan_is_counted() -> None:
    notes = Notes()
    empty = RawScan(STAMP, STAMP, np.empty((0, 3), np.float32), np.empty(0, np.float32))
    assert TimeResolver(TimeHint(), notes).resolve(empty) is None
    assert notes.counts == {"scans_empty": 1}


def test_times_of_reception_mark_the_end_of_the_scan() -> None:
    resolver = TimeResolver(TimeHint(), Notes(), log_times=True)
    scan = resolver.resolve(raw(OFFSETS.astype(np.uint32)))
    assert scan is not None
    assert scan_end(scan) == STAMP + NS // 10


@pytest.mark.parametrize(
    ("stamp", "text"), [(0, "0.000000000"), (STAMP, "1700000000.987654321"), (-1, "-0.000000001")]
)
def test_stamps_as_text_are_exact(stamp: int, text: str) -> None:
    assert seconds(stamp) == text
