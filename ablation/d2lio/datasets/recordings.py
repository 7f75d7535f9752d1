# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Finds the recordings below a directory: bags, shards of one bag, ROS 2 directories."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from d2lio.datasets.bagfile import BagFile, open_files
from d2lio.datasets.recognise import names_sequence
from d2lio.errors import DataError

SUFFIXES = (".bag", ".mcap")
# rosbag record --split: NAME_2023-07-25-14-10-11_3.bag; others: NAME_3.bag
_SHARD = re.compile(r"(_\d{4}(-\d+){5})?_\d+$")


@dataclass(frozen=True, slots=True)
class Recording:
    """One or several files that belong together; `path` is the file or their directory."""

    path: Path
    files: tuple[Path, ...]

    def open(self) -> BagFile:
        """Opens all files as one.

        Raises:
            DataError: see `open_bag`.
        """
        return open_files(self.files, self.path)

    @property
    def size_bytes(self) -> int:
        """Bytes on disk."""
        inner = [f for p in self.files for f in (p.rglob("*") if p.is_dir() else [p])]
        return sum(f.stat().st_size for f in inner if f.is_file())


def find_recordings(root: Path) -> list[Recording]:
    """Recordings below `root`, by path; a file is a recording itself.

    Raises:
        DataError: nothing of that name.
    """
    if not root.exists():
        raise DataError(f"{root}: no such file or directory")
    if root.is_file():
        return [Recording(root, (root,))]
    ros2 = sorted(p.parent for p in root.rglob("metadata.yaml"))
    found = [Recording(p, (p,)) for p in ros2]
    files = [
        f
        for f in sorted(root.rglob("*"))
        if f.suffix in SUFFIXES and f.is_file() and not any(p in f.parents for p in ros2)
    ]
    groups: dict[tuple[Path, str], list[Path]] = {}
    for file in files:
        groups.setdefault((file.parent, _group(file)), []).append(file)
    for (folder, _), members in groups.items():
        path = folder if len(members) > 1 else members[0]
        found.append(Recording(path, tuple(sorted(members))))
    return sorted(found, key=lambda r: (str(r.path), str(r.files[0])))


def _group(file: Path) -> str:
    """What shards of one recording have in common; a file named after a sequence is whole."""
    if names_sequence(file.stem):
        return file.name
    return _SHARD.sub("", file.stem) + file.suffix
