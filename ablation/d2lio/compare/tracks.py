# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What a comparison shows of one variant, read from the files that its run left."""

from __future__ import annotations

import csv
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.ablate.cell import TRUTH_FILE
from d2lio.ablate.results import ResultRow, Results
from d2lio.compare.shared.board import Counts, Line
from d2lio.compare.shared.names import COLOURS
from d2lio.compare.shared.running import MIN_PAIRS, RunningApe, align
from d2lio.errors import DataError
from d2lio.metrics.matching import match
from d2lio.metrics.tum import Trajectory, finite, read_tum
from d2lio.record import DIAGNOSTICS_FILE, TRAJECTORY_FILE

Row = dict[str, str]
EMPTY = Trajectory(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 4)))


@dataclass(slots=True)
class Track:
    """One variant.

    Attributes:
        id, title, colour: as in the report.
        failed: why its row is a FAIL, empty where it is not.
        poses: T_map_imu, finite ones only.
        R, t: move its map frame onto the truth's, so that the first poses agree; without attitudes
            in the truth, or without a truth, all positions (least squares), or nothing.
        stamps, error: int64 [N] ns and m [N]: distance to the truth with all positions aligned.
        rows: of diagnostics.csv, without scans that the host skips on purpose.
    """

    id: str
    title: str
    colour: str
    failed: str = ""
    poses: Trajectory = field(default_factory=lambda: EMPTY)
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    stamps: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    error: np.ndarray = field(default_factory=lambda: np.empty(0))
    rows: list[Row] = field(default_factory=list)

    @property
    def positions(self) -> np.ndarray:
        """Of its poses in the truth's frame, float64 [N, 3], m."""
        return self.poses.positions @ self.R.T + self.t


def read_tracks(results: Results) -> tuple[list[Track], Trajectory | None]:
    """The variants in the order of the suite, and the truth where there is one."""
    truth = _truth(results)
    order = [variant.id for variant in results.suite.variants]
    tracks = []
    for row in results.rows:
        colour = COLOURS[order.index(row.variant) % len(COLOURS)]
        track = Track(row.variant, row.variant_title, colour, _failed(row))
        _read(track, results.out / row.directory, truth)
        tracks.append(track)
    return tracks, truth


def _failed(row: ResultRow) -> str:
    return "" if row.status == "ok" else row.reason or "failed"


def _truth(results: Results) -> Trajectory | None:
    for row in results.rows:
        with suppress(DataError):
            return read_tum(results.out / row.directory / TRUTH_FILE)
    return None


def _read(track: Track, directory: Path, truth: Trajectory | None) -> None:
    with suppress(OSError, csv.Error):
        track.rows = read_rows(directory / DIAGNOSTICS_FILE)
    try:
        poses = read_tum(directory / TRAJECTORY_FILE)
    except DataError:
        return
    track.poses = poses.select(finite(poses))
    if truth is None or not len(track.poses):
        return
    pair = match(truth, track.poses)
    if len(pair.truth) < MIN_PAIRS:
        return
    ours, theirs = pair.estimate.positions, pair.truth.positions
    R, t = align(ours, theirs)
    track.stamps = pair.truth.stamps
    track.error = np.linalg.norm(ours @ R.T + t - theirs, axis=1)
    if not truth.position_only:
        first = [
            Rotation.from_quat(x.quaternions[0]).as_matrix() for x in (pair.truth, pair.estimate)
        ]
        R = first[0] @ first[1].T
        t = theirs[0] - R @ ours[0]
    track.R, track.t = R, t


def read_rows(file: Path) -> list[Row]:
    """Rows of a diagnostics.csv as texts; those of skipped scans are left out.

    Raises:
        OSError, csv.Error: unreadable.
    """
    with file.open(newline="", encoding="utf-8") as stream:
        return [row for row in csv.DictReader(stream) if row.get("status") != "skipped"]


class Replay:
    """The scoreboard at any moment of a sequence; moments must not go back."""

    def __init__(self, tracks: list[Track], truth: Trajectory | None) -> None:
        self._tracks = tracks
        self._counts = [Counts() for _ in tracks]
        self._next = [0 for _ in tracks]
        self._apes = [_ape(track, truth) for track in tracks]

    def at(self, stamp: int) -> list[Line]:
        """The lines when all scans up to `stamp`, ns, were done."""
        lines = []
        for index, track in enumerate(self._tracks):
            self._advance(index, stamp)
            ape = self._apes[index].rmse(until=stamp) if len(self._apes[index]) else None
            poses = int(np.searchsorted(track.poses.stamps, stamp, side="right"))
            lines.append(self._counts[index].line(track.title, "", ape, poses))
        return lines

    def end(self) -> list[Line]:
        """The lines at the end; failed variants say so."""
        lines = self.at(np.iinfo(np.int64).max)
        failed = [track.failed for track in self._tracks]
        return [x._replace(state="FAIL") if f else x for x, f in zip(lines, failed, strict=True)]

    def _advance(self, index: int, stamp: int) -> None:
        rows = self._tracks[index].rows
        while self._next[index] < len(rows):
            row = rows[self._next[index]]
            if int(row["stamp_ns"]) > stamp:
                return
            self._counts[index].add(row)
            self._next[index] += 1


def _ape(track: Track, truth: Trajectory | None) -> RunningApe:
    known = truth if truth is not None else EMPTY
    ape = RunningApe(known.stamps, known.positions)
    for stamp, position in zip(track.poses.stamps, track.poses.positions, strict=True):
        ape.add(int(stamp), position)
    return ape
