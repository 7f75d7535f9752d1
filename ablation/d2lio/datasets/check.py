# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Says of a recording what is there, what is missing and what looks wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from d2lio.datasets.bag import CLOUD_TYPES
from d2lio.datasets.bagfile import BagFile, Topic
from d2lio.datasets.catalog import Device, KnownSequence
from d2lio.datasets.check_streams import ImuStream, LidarStream, Measured, Stream, measure
from d2lio.datasets.clocks import APART_ERROR_S, APART_NOTE_S
from d2lio.datasets.config import SourceConfig
from d2lio.datasets.events import NS_PER_S
from d2lio.datasets.recognise import Match, find_truth, recognise
from d2lio.datasets.recordings import Recording
from d2lio.datasets.truth import read_truth
from d2lio.errors import DataError

Level = Literal["ok", "note", "wrong", "missing"]

RATE_TOLERANCE = 0.05  # share of the nominal rate
G_RANGE = (0.8, 1.2)  # median length of the acceleration of an IMU that measures in g
SI_RANGE = (8.8, 10.8)  # and in m/s^2
CLOCK_NOTE_S = 5.0  # a recorder's clock further off than this is another clock
DURATION_SHARE = 0.9  # of the published duration; less is a download cut off
NAN_NOTE = 0.01


@dataclass(frozen=True, slots=True)
class Finding:
    """One remark: level, what it is about, in words."""

    level: Level
    what: str
    text: str


@dataclass(slots=True)
class Report:
    """Everything said about a recording."""

    recording: Recording
    match: Match | None = None
    topics: list[Topic] = field(default_factory=list)
    duration_s: float = 0.0
    measured: Measured | None = None
    truth_file: Path | None = None
    findings: list[Finding] = field(default_factory=list)

    def add(self, level: Level, what: str, text: str) -> None:
        """Adds a finding."""
        self.findings.append(Finding(level, what, text))

    @property
    def verdict(self) -> Level:
        """The worst level of all findings."""
        order: tuple[Level, ...] = ("missing", "wrong", "note")
        return next((lv for lv in order if any(f.level == lv for f in self.findings)), "ok")


def check_recording(
    recording: Recording,
    limit_s: float | None = 20.0,
    progress: Callable[[float, float], None] | None = None,
) -> Report:
    """Reads the first `limit_s` seconds of a recording, None for all of it, and judges them."""
    report = Report(recording)
    try:
        bag = recording.open()
    except DataError as err:
        report.match = recognise(recording.files[0], {})
        report.add("wrong", "file", str(err))
        return report
    with bag:
        _examine(report, bag, limit_s, progress)
    return report


def _examine(
    report: Report,
    bag: BagFile,
    limit_s: float | None,
    progress: Callable[[float, float], None] | None,
) -> None:
    report.topics = bag.topics
    report.duration_s = max(0.0, (bag.end - bag.begin) / NS_PER_S)
    types = {t.name: t.msgtype for t in bag.topics if t.count}
    report.match = recognise(report.recording.files[0], types)
    device = report.match.device if report.match else None
    config = device.source_config("", types) if device else SourceConfig()
    lidar_topic = _lidar_topic(report, device, types)
    report.measured = measure(bag, lidar_topic, config, limit_s, progress)
    if report.measured.damage:
        after = f"damaged after {report.measured.seconds:.1f} s: {report.measured.damage}"
        report.add("wrong", "file", after)
    _judge(report)
    _judge_known(report, bag)


def _lidar_topic(report: Report, device: Device | None, types: dict[str, str]) -> str | None:
    if device is not None:
        stream = device.stream(types)
        if types.get(stream.topic) == stream.type:
            return stream.topic
        held = types.get(stream.topic)
        said = f"is a {held}, not a {stream.type}" if held else "no such topic"
        report.add("missing", stream.topic, f"{device.sensor}: {said}")
        return None
    clouds = [name for name, kind in types.items() if kind in CLOUD_TYPES]
    if not clouds:
        report.add("missing", "lidar", "no topic of a type that can be read")
    elif len(clouds) > 1:
        report.add("note", "lidar", f"several LiDAR topics, the first is checked: {clouds}")
    return clouds[0] if clouds else None


def _judge(report: Report) -> None:
    measured, device = report.measured, report.match.device if report.match else None
    assert measured is not None
    if measured.lidar is not None:
        _judge_stream(report, measured.lidar.topic, measured.lidar, _nominal(device))
        _judge_points(report, measured.lidar.topic, measured.lidar, device)
    known = {i.topic: i for i in ([device.imu, *device.other_imus] if device else [])}
    for name, imu in measured.imus.items():
        source = known.get(name)
        _judge_stream(report, name, imu, source.rate_hz if source else None)
        _judge_unit(report, name, imu, source.accel_unit if source else None)
    if device is not None and device.imu.topic not in measured.imus:
        report.add("missing", str(device.imu.topic), "no such IMU topic")
    elif not measured.imus:
        report.add("missing", "imu", "no sensor_msgs/Imu topic")
    _judge_clocks(report)


def _nominal(device: Device | None) -> float | None:
    return device.lidar.rate_hz if device else None


def _judge_stream(report: Report, name: str, stream: Stream, nominal: float | None) -> None:
    rate = stream.rate_hz
    if rate is None:
        report.add("wrong", name, f"{len(stream)} messages whose stamps do not grow")
        return
    if nominal is not None and abs(rate / nominal - 1.0) > RATE_TOLERANCE:
        report.add("wrong", name, f"{rate:.1f} Hz instead of {nominal:g} Hz")
    gaps = stream.gaps_s(1.0 / rate)
    if len(gaps):
        report.add("wrong", name, f"{len(gaps)} gaps, the longest {gaps.max():.2f} s")
    back = int((stream.steps_s() < 0.0).sum())
    same = int((stream.steps_s() == 0.0).sum())
    if back or same:
        report.add("note", name, f"stamps go back {back} times, stay the same {same} times")


def _judge_points(report: Report, name: str, lidar: LidarStream, device: Device | None) -> None:
    if lidar.points == 0:
        report.add("wrong", name, "scans without points")
        return
    nan, zero = lidar.nan / lidar.points, lidar.zero / lidar.points
    if max(nan, zero) > NAN_NOTE:
        report.add("note", name, f"{nan:.1%} of the points are NaN, {zero:.1%} at the origin")
    if device is not None and lidar.rings > device.lidar.rings:
        report.add("wrong", name, f"ring {lidar.rings - 1} of a {device.lidar.rings}-ring sensor")
    for reason, number in sorted(lidar.notes.counts.items()):
        report.add("note", name, f"{number} {reason.replace('_', ' ')}")
    _judge_times(report, name, lidar, device)


def _judge_times(report: Report, name: str, lidar: LidarStream, device: Device | None) -> None:
    if not lidar.has_times:
        report.add("missing", name, "the points have no time field")
        return
    if lidar.time_error or lidar.found is None:
        report.add("wrong", name, f"point times: {lidar.time_error or 'not understood'}")
        return
    found = lidar.found
    report.add("ok", name, f"point times in {found.unit} from the {_reference(found.reference)}")
    known = device.lidar if device else None
    if known is None or known.time_reference in ("auto", found.reference):
        return
    said = f"point times count from the {_reference(found.reference)}, "
    report.add("wrong", name, said + f"known is the {_reference(known.time_reference)}")


def _reference(name: str) -> str:
    return {"start": "scan's start (stamp)", "end": "scan's end (stamp)"}.get(name, "clock's epoch")


def _judge_unit(report: Report, name: str, imu: ImuStream, unit: str | None) -> None:
    norm = imu.accel_norm
    if G_RANGE[0] <= norm <= G_RANGE[1]:
        level: Level = "ok" if unit == "g" else "wrong" if unit else "note"
        report.add(level, name, f"accelerations in g (median {norm:.3f}): accel_unit is g")
    elif SI_RANGE[0] <= norm <= SI_RANGE[1]:
        if unit == "g":
            report.add("wrong", name, f"accelerations in m/s^2 (median {norm:.2f}), known is g")
    else:
        report.add("wrong", name, f"accelerations of {norm:.3f} at the median, in no known unit")


def _judge_clocks(report: Report) -> None:
    measured = report.measured
    assert measured is not None
    lidar = measured.lidar
    if lidar is None or not len(lidar):
        return
    if abs(lidar.clock_s) > CLOCK_NOTE_S:
        text = f"header stamps lie {lidar.clock_s:+.1f} s from the recorder's clock; headers count"
        report.add("note", "clocks", text)
    for name, imu in measured.imus.items():
        if not len(imu):
            continue
        apart = imu.clock_s - lidar.clock_s
        if abs(apart) > APART_ERROR_S:
            text = f"{name} and the LiDAR are {apart:+.1f} s apart: different clocks"
            report.add("wrong", "clocks", text)
        elif abs(apart) > APART_NOTE_S:
            report.add("note", "clocks", f"{name} and the LiDAR are {apart:+.2f} s apart")


def _judge_known(report: Report, bag: BagFile) -> None:
    match = report.match
    if match is None:
        report.add("note", "data set", "not a known one; nothing nominal to compare with")
        return
    if match.by == "topics":
        report.add("note", "data set", "guessed from the topics alone; no sequence's name found")
    for remark in match.device.remarks():
        report.add("note", "data set", remark)
    if match.sequence is not None:
        _judge_duration(report, match.sequence)
        _judge_truth(report, match, bag)


def _judge_duration(report: Report, sequence: KnownSequence) -> None:
    known = sequence.duration_s
    if known is not None and report.duration_s < DURATION_SHARE * known:
        text = f"{report.duration_s:.0f} s recorded of {known:.0f} s published (cut off?)"
        report.add("note", "duration", text)


def _judge_truth(report: Report, match: Match, bag: BagFile) -> None:
    if match.truth is None:
        report.add("note", "truth", "none was published")
        return
    report.truth_file = find_truth(report.recording.path, match)
    if report.truth_file is None:
        names = ", ".join(_truth_names(match))
        report.add("missing", "truth", f"no {names} beside the recording or in the folders above")
        return
    try:
        truth = read_truth(report.truth_file, match.truth, match.device_name)
    except DataError as err:
        report.add("wrong", "truth", str(err))
        return
    for note in truth.notes:
        report.add("note", "truth", note)
    if truth.trajectory.position_only != match.truth.position_only:
        held = "positions only" if truth.trajectory.position_only else "poses"
        report.add("note", "truth", f"holds {held}, not what is known of it")
    _judge_overlap(report, bag, truth.trajectory.stamps.tolist())


def _truth_names(match: Match) -> Iterator[str]:
    assert match.truth is not None
    assert match.sequence is not None
    for pattern in match.truth.files:
        yield pattern.format(sequence=match.sequence.name, base=match.sequence.base)


def _judge_overlap(report: Report, bag: BagFile, stamps: list[int]) -> None:
    lidar = report.measured.lidar if report.measured else None
    if lidar is None or not len(lidar):
        return
    shift = round(lidar.clock_s * NS_PER_S)
    begin, end = bag.begin + shift, bag.end + shift
    common = max(0, min(end, stamps[-1]) - max(begin, stamps[0])) / NS_PER_S
    share = common / report.duration_s if report.duration_s > 0.0 else 0.0
    text = f"{len(stamps)} poses over {common:.1f} s of the recording ({share:.0%})"
    report.add("wrong" if common <= 0.0 else "ok", "truth", text)
