# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tells which known sequence a recording is, by its folder and topics, and finds its truth."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from d2lio.datasets.catalog import Dataset, Device, KnownSequence, Truth, datasets

FOLDERS_UP = 3  # whose names may tell the data set
TRUTH_LEVELS_UP = 3  # SEQ.bag in sensor_data/ENV/SEQ, its truth in groundtruth/traj
TRUTH_FOLDERS = (".", "traj", "groundtruth", "groundtruth/traj", "ground_truth", "gt")


@dataclass(frozen=True, slots=True)
class Match:
    """What a recording is taken for; `by` says why: name (of the sequence), folder or topics."""

    dataset: Dataset
    device_name: str
    sequence: KnownSequence | None
    by: str

    @property
    def device(self) -> Device:
        """The payload's description."""
        return self.dataset.devices[self.device_name]

    @property
    def truth(self) -> Truth | None:
        """The kind of ground truth, where the sequence is known."""
        name = self.sequence.truth if self.sequence else None
        return self.dataset.truths[name] if name else None


def _holds(text: str, name: str) -> bool:
    """Whether a path's part holds the name as a whole word."""
    found = re.search(rf"(?<![A-Za-z0-9]){re.escape(name)}(?![A-Za-z0-9])", text, re.IGNORECASE)
    return found is not None


def _by_name(text: str) -> tuple[Dataset, KnownSequence] | None:
    """The sequence with the longest name in `text`."""
    best: tuple[int, Dataset, KnownSequence] | None = None
    for dataset in datasets().values():
        for sequence in dataset.sequences:
            for name in (sequence.name, *sequence.aliases):
                if _holds(text, name) and (best is None or len(name) > best[0]):
                    best = (len(name), dataset, sequence)
        best = best or _by_pattern(dataset, text)
    return None if best is None else best[1:]


def _by_pattern(dataset: Dataset, text: str) -> tuple[int, Dataset, KnownSequence] | None:
    for pattern in dataset.patterns:
        found = re.search(rf"(?<![A-Za-z0-9])({pattern.regex})(?![A-Za-z0-9])", text, re.IGNORECASE)
        if found:
            name = found.group(1)
            sequence = KnownSequence(name=name, device=pattern.device, truth=pattern.truth)
            return len(name), dataset, sequence
    return None


def _parts(path: Path) -> Iterable[str]:
    """File stem first, then folders upwards."""
    absolute = path.absolute()
    yield absolute.stem if path.suffix in (".bag", ".mcap", ".db3") else absolute.name
    yield from (parent.name for parent in absolute.parents[:FOLDERS_UP])


def has_topics(device: Device, topics: dict[str, str]) -> bool:
    """Whether the device's LiDAR, in one of its forms, and its IMU are there."""
    lidar = any(topics.get(s.topic) == s.type for s in device.lidars)
    return lidar and device.imu.topic in topics


def _of_dataset(dataset: Dataset, topics: dict[str, str], by: str) -> Match | None:
    fitting = [name for name, each in dataset.devices.items() if has_topics(each, topics)]
    return Match(dataset, fitting[0], None, by) if len(fitting) == 1 else None


def recognise(path: Path, topics: dict[str, str]) -> Match | None:
    """What the recording is: by a sequence's name, a data set's folder, else by topics alone.

    Args:
        path: bag or directory.
        topics: name to message type (pkg/msg/Type).
    """
    parts = list(_parts(path))
    for text in parts:
        named = _by_name(text)
        if named is not None:
            return Match(named[0], named[1].device, named[1], "name")
    for dataset in datasets().values():
        if any(text.lower() in dataset.folders for text in parts):
            return _of_dataset(dataset, topics, "folder")
    matches = [m for d in datasets().values() if (m := _of_dataset(d, topics, "topics"))]
    return matches[0] if len(matches) == 1 else None


def find_truth(path: Path, match: Match) -> Path | None:
    """The ground truth's file beside the recording or in the folders around it."""
    truth, sequence = match.truth, match.sequence
    if truth is None or sequence is None:
        return None
    folder = path.absolute() if path.is_dir() else path.absolute().parent
    for level, base in enumerate((folder, *folder.parents)):
        if level > TRUTH_LEVELS_UP:
            return None
        for pattern in truth.files:
            # A name without the sequence in it is that of its own folder only.
            if "{" not in pattern and level > 1:
                continue
            name = pattern.format(sequence=sequence.name, base=sequence.base).lower()
            found = [f for where in TRUTH_FOLDERS for f in _files(base / where, name)]
            if found:
                return found[0]
    return None


def _files(folder: Path, name: str) -> list[Path]:
    """Files of that name whatever the case of its letters."""
    if not folder.is_dir():
        return []
    return sorted(f for f in folder.iterdir() if f.name.lower() == name and f.is_file())


def names_sequence(text: str) -> bool:
    """Whether the text holds the name of a known sequence."""
    return _by_name(text) is not None
