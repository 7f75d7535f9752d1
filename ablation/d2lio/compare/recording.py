# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A comparison as a recording for the rerun viewer.

rerun-sdk is an optional dependency (100 MB as a wheel, 300 MB unpacked, most of it the viewer); it
is imported only here and in `blueprint`, and only when called.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from d2lio.ablate.results import Results
from d2lio.compare import blueprint
from d2lio.compare.blueprint import TIMELINE
from d2lio.compare.clouds import Cloud, registered
from d2lio.compare.shared import board
from d2lio.compare.shared.names import TRUTH_COLOUR, rgb
from d2lio.compare.tracks import Replay, Row, Track, read_tracks
from d2lio.datasets.events import NS_PER_S
from d2lio.datasets.source import Source
from d2lio.errors import DataError
from d2lio.metrics.tum import Trajectory
from d2lio.report.cloud import load_map

LEAST_EIGENVALUE = 1e-3  # points; rows cleaned of noise leave rounding alone below it
APPLICATION = "d2lio_compare"
RECORDING_FILE = "compare.rrd"
BOARDS = 300  # states of the scoreboard over a sequence, at most one per second
PATH_RADIUS = -1.5  # negative: in pixels of the screen
CLOUD_RADIUS = -1.0
BODY_RADIUS = -5.0
ARROW_RADIUS = -4.0
MAP_COLOUR = (110, 110, 110)
ARROW_SHARE = 0.04  # of the extent of all paths
MIN_ARROW_M = 0.5


def missing() -> str | None:
    """Why no recording can be written here; None where it can."""
    try:
        import rerun  # noqa: F401
    except ImportError:
        return "the recording needs rerun: pip install 'd2lio[view]'"
    return None


def write(results: Results, source: Source | None, file: Path) -> Path:
    """Writes the recording, in one go.

    Args:
        source: opened anew; None leaves the clouds out.

    Raises:
        DataError: rerun is not installed, unreadable input, or an unwritable file.
    """
    if (why := missing()) is not None:
        raise DataError(why)
    import rerun as rr

    tracks, truth = read_tracks(results)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{file.name}-", dir=file.parent))
    except OSError as err:
        raise DataError(f"{file}: cannot be written: {err.strerror}") from None
    try:
        # The viewer remembers an arrangement by this name; it fits the same variants only.
        stream = rr.RecordingStream("_".join([APPLICATION, *(track.id for track in tracks)]))
        stream.save(folder / file.name, default_blueprint=blueprint.make(tracks))
        _Writer(rr, stream, tracks, truth).write(results, source)
        stream.disconnect()
        os.replace(folder / file.name, file)
    except OSError as err:
        raise DataError(f"{file}: cannot be written: {err}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return file


def open_viewer(file: Path) -> bool:
    """Opens the viewer where there is a display; whether it was started."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    subprocess.Popen(
        [sys.executable, "-m", "rerun", str(file)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # it stays when we are done
    )
    return True


class _Writer:
    """Logs one comparison into a stream; times count from the first stamp, s."""

    def __init__(self, rr: Any, stream: Any, tracks: list[Track], truth: Trajectory | None) -> None:
        self._rr, self._stream = rr, stream
        self._tracks, self._truth = tracks, truth
        stamps = [track.poses.stamps for track in tracks if len(track.poses)]
        stamps += [truth.stamps] if truth is not None and len(truth) else []
        self._begin = min((int(s[0]) for s in stamps), default=0)
        self._end = max((int(t.poses.stamps[-1]) for t in tracks if len(t.poses)), default=0)

    def write(self, results: Results, source: Source | None) -> None:
        self._stream.log("world", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._surroundings(results)
        for track in self._tracks:
            self._path(track)
            self._weak(track)
            self._plots(track)
        self._boards()
        if source is not None:
            self._clouds(registered(source, self._tracks))

    def _times(self, stamps: Iterable[int]) -> Any:
        seconds = (np.asarray(list(stamps), np.int64) - self._begin) / NS_PER_S
        return self._rr.TimeColumn(TIMELINE, duration=seconds)

    def _send(self, entity: str, stamps: Iterable[int], columns: Any) -> None:
        self._rr.send_columns(
            entity, indexes=[self._times(stamps)], columns=columns, recording=self._stream
        )

    def _surroundings(self, results: Results) -> None:
        if self._truth is None:
            return
        rr = self._rr
        places = self._truth.positions
        line = rr.LineStrips3D([places], colors=[rgb(TRUTH_COLOUR)], radii=PATH_RADIUS)
        self._stream.log("world/truth", line, static=True)
        sequence = results.suite.sequences[0]
        points = load_map(results.out, sequence, 0, places)
        cloud = rr.Points3D(points, colors=[MAP_COLOUR], radii=CLOUD_RADIUS)
        self._stream.log("world/map", cloud, static=True)

    def _path(self, track: Track) -> None:
        places = track.positions.astype(np.float32)
        if len(places) < 2:
            return
        rr, entity = self._rr, f"world/{track.id}"
        look = {"colors": [rgb(track.colour)], "radii": [PATH_RADIUS]}
        self._stream.log(f"{entity}/path", rr.LineStrips3D.from_fields(**look), static=True)
        steps = np.stack([places[:-1], places[1:]], axis=1)
        self._send(
            f"{entity}/path", track.poses.stamps[1:], rr.LineStrips3D.columns(strips=list(steps))
        )
        here = rr.Points3D.from_fields(colors=[rgb(track.colour)], radii=[BODY_RADIUS])
        self._stream.log(f"{entity}/body", here, static=True)
        self._send(f"{entity}/body", track.poses.stamps, rr.Points3D.columns(positions=places))

    def _weak(self, track: Track) -> None:
        """Arrows both ways along each weak direction of the translation, from the body."""
        rr, entity = self._rr, f"world/{track.id}/weak"
        length = max(ARROW_SHARE * self._extent(), MIN_ARROW_M)
        places = dict(zip(track.poses.stamps.tolist(), track.positions, strict=True))
        stamps, counts, origins, vectors = [], [], [], []
        for row in track.rows:
            stamp = int(row["stamp_ns"])
            if stamp not in places:
                continue
            found = [length * track.R @ v for v in weak_directions(row)]
            stamps.append(stamp)
            counts.append(2 * len(found))
            vectors += [sign * v for v in found for sign in (1.0, -1.0)]
            origins += [places[stamp]] * counts[-1]
        if not vectors:
            return
        look = rr.Arrows3D.from_fields(colors=[rgb(track.colour)], radii=[ARROW_RADIUS])
        self._stream.log(entity, look, static=True)
        columns = rr.Arrows3D.columns(vectors=vectors, origins=origins)
        self._send(entity, stamps, columns.partition(counts))

    def _extent(self) -> float:
        places = [t.positions for t in self._tracks if len(t.poses)]
        if self._truth is not None:
            places = [self._truth.positions]
        if not places:
            return 0.0
        return float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0)))

    def _plots(self, track: Track) -> None:
        curves = {"error": (track.stamps, track.error)} | plotted(track.rows)
        for key, (stamps, values) in curves.items():
            entity = f"plots/{key}/{track.id}"
            style = self._rr.SeriesLines(
                colors=[rgb(track.colour)], names=[track.title], widths=[1.5]
            )
            self._stream.log(entity, style, static=True)
            if len(stamps):
                self._send(entity, stamps, self._rr.Scalars.columns(scalars=values))

    def _boards(self) -> None:
        replay = Replay(self._tracks, self._truth)
        states = int(np.clip((self._end - self._begin) / NS_PER_S, 1, BOARDS))
        moments = np.linspace(self._begin, self._end, states + 1).astype(np.int64)
        texts = [board.markdown(replay.at(int(moment))) for moment in moments[:-1]]
        texts.append(final_text(replay, self._tracks))
        kinds = [self._rr.MediaType.MARKDOWN] * len(texts)
        columns = self._rr.TextDocument.columns(text=texts, media_type=kinds)
        self._send("scoreboard", moments.tolist(), columns)

    def _clouds(self, clouds: Iterable[Cloud]) -> None:
        rr = self._rr
        kept: dict[str, list[Cloud]] = defaultdict(list)
        for cloud in clouds:
            kept[cloud.track.id].append(cloud)
        for name, own in kept.items():
            entity = f"world/{name}/cloud"
            look = rr.Points3D.from_fields(colors=[rgb(own[0].track.colour)], radii=[CLOUD_RADIUS])
            self._stream.log(entity, look, static=True)
            points = rr.Points3D.columns(positions=np.concatenate([c.points for c in own]))
            self._send(
                entity, [c.stamp for c in own], points.partition([len(c.points) for c in own])
            )


def weak_directions(row: Row) -> list[np.ndarray]:
    """Weak directions of the translation in the map frame, unit vectors [3]."""
    count = int(board.number(row.get("weak_t")) or 0)
    found = []
    for index in range(1, min(count, 3) + 1):
        vector = [board.number(row.get(f"v_t_{index}_{axis}")) for axis in "xyz"]
        if None not in vector:
            found.append(np.array(vector, np.float64))
    return found


def plotted(rows: list[Row]) -> dict[str, tuple[list[int], list[float]]]:
    """Stamps, ns, and values of the plots that are made of diagnostics, by their key."""
    curves: dict[str, tuple[list[int], list[float]]] = {
        key: ([], []) for key in ("lambda", "rejected", "time")
    }
    for row in rows:
        stamp = int(row["stamp_ns"])
        for key, value in _values(row).items():
            if value is not None:
                curves[key][0].append(stamp)
                curves[key][1].append(value)
    return curves


def _values(row: Row) -> dict[str, float | None]:
    smallest = board.number(row.get("lambda_t_1"))
    offered, accepted = (board.number(row.get(k)) for k in ("offered", "accepted"))
    rejected = None
    if offered and accepted is not None:
        rejected = 100.0 * (1.0 - accepted / offered)
    return {
        "lambda": None if smallest is None else float(np.log10(max(smallest, LEAST_EIGENVALUE))),
        "rejected": rejected,
        "time": board.number(row.get("time_total_ms")),
    }


def final_text(replay: Replay, tracks: list[Track]) -> str:
    """The scoreboard at the end, with the reasons of failures under it."""
    reasons = [f"- **{track.title}**: {track.failed}" for track in tracks if track.failed]
    return "\n".join([board.markdown(replay.end()), "", *reasons])
