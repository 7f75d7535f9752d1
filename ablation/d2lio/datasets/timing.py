# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Turns the stored per-point time field into offsets from the scan's start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from d2lio.datasets.events import NS_PER_S, Event, Notes, RawEvent, RawScan, Reader, Scan, TimeHint
from d2lio.errors import DataError

# The core says what it found in words; the same setting as a hint has a short name.
REFERENCE_NAMES = {
    "a stamp at the scan start": "start",
    "a stamp at the scan end": "end",
    "the clock's epoch": "absolute",
}
NO_TIMES = (
    "the cloud has no per-point times; set `lidar.synchronised: true` if it is motion compensated, "
    "or `lidar.pseudo_times: true` to estimate them from the azimuth"
)
BAD_SCANS_IN_A_ROW = 10  # a source whose first scans all fail has a setting wrong


class TimeResolver:
    """Resolves scan after scan; what the first good scan shows holds for the rest of the run.

    Args:
        hint: what is known beforehand.
        notes: receives the convention found and the counts of scans that were dropped.
        log_times: take the time of reception as the scan's end instead of the header stamp.
    """

    def __init__(self, hint: TimeHint, notes: Notes, *, log_times: bool = False) -> None:
        self._hint = hint
        self._notes = notes
        self._log_times = log_times
        self._locked = False
        self._failed_at_start = 0

    @property
    def found(self) -> TimeHint | None:
        """Unit and reference the first good scan showed, None before it."""
        return self._hint if self._locked else None

    def resolve(self, raw: RawScan) -> Scan | None:
        """The scan with its times; None for a scan that must be dropped (counted).

        Raises:
            DataError: the point times of the source cannot be understood.
        """
        if len(raw) == 0:
            self._notes.count("scans_empty")
            return None
        if self._hint.synchronised:
            return self._finish(raw, raw.stamp, np.zeros(len(raw), np.int32))
        found = self._ask(raw)
        if found["status"] != "ok":
            return self._refuse(raw, found)
        self._learn(found)
        return self._finish(raw, int(found["stamp"]), np.asarray(found["dt_ns"], np.int32))

    def _ask(self, raw: RawScan) -> dict:
        from d2lio._core import resolve_point_times

        if raw.times is None:
            return {"status": "absent", "message": NO_TIMES}
        # int64 keeps absolute nanoseconds exact, float64 does not.
        exact = raw.times.dtype.kind in "iu"
        values = raw.times.astype(np.int64 if exact else np.float64)
        hint = self._hint
        return resolve_point_times(
            values,
            raw.stamp,
            unit=hint.unit,
            reference=hint.reference,
            period_s=hint.period_s,
            synchronised=False,
            pseudo=hint.pseudo,
        )

    def _learn(self, found: dict) -> None:
        if self._locked:
            return
        self._locked = True
        reference = REFERENCE_NAMES.get(found["reference"], found["reference"])
        self._hint = replace(self._hint, unit=found["unit"], reference=reference)
        self._notes.tell(found["message"])

    def _refuse(self, raw: RawScan, found: dict) -> Scan | None:
        if self._hint.pseudo and found["status"] in ("absent", "all_equal", "not_finite"):
            return self._pseudo(raw)
        if not self._locked:
            self._failed_at_start += 1
            hopeless = found["status"] in ("absent", "clock_mismatch")
            if hopeless or self._failed_at_start >= BAD_SCANS_IN_A_ROW:
                raise DataError(found["message"])
        self._notes.count(f"scans_bad_times_{found['status']}")
        return None

    def _pseudo(self, raw: RawScan) -> Scan | None:
        from d2lio._core import pseudo_times_by_azimuth

        ring = np.zeros(len(raw), np.uint16) if raw.ring is None else raw.ring
        dt_ns = pseudo_times_by_azimuth(raw.xyz, ring, self._hint.period_s)
        self._locked = True
        self._notes.tell("point times: estimated from the azimuth (the cloud has none)")
        return self._finish(raw, raw.stamp, np.asarray(dt_ns, np.int32))

    def _finish(self, raw: RawScan, stamp: int, dt_ns: np.ndarray) -> Scan:
        if self._log_times:
            stamp = raw.log_stamp - int(dt_ns.max())
        return Scan(stamp, raw.xyz, dt_ns, raw.intensity, raw.ring)


def timed_events(reader: Reader, *, log_times: bool = False) -> Iterator[Event]:
    """A reader's events with resolved point times.

    Raises:
        DataError: unreadable input or times that cannot be understood.
    """
    resolver = TimeResolver(reader.time_hint, reader.notes, log_times=log_times)
    for event in reader.raw_events():
        scan = _timed(resolver, event)
        if scan is not None:
            yield scan


def _timed(resolver: TimeResolver, event: RawEvent) -> Event | None:
    return resolver.resolve(event) if isinstance(event, RawScan) else event


def scan_end(scan: Scan) -> int:
    """Time of the scan's latest point, ns."""
    return scan.stamp + int(scan.dt_ns.max(initial=0))


def seconds(stamp: int) -> str:
    """Stamp in seconds with all nine decimals, exactly."""
    sign = "-" if stamp < 0 else ""
    whole, rest = divmod(abs(stamp), NS_PER_S)
    return f"{sign}{whole}.{rest:09d}"
