# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Opens ROS 1 bags, ROS 2 bags and MCAP files behind one small interface."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError

from d2lio.errors import DataError

MCAP_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic of a bag; `msgtype` in the long form pkg/msg/Type."""

    name: str
    msgtype: str
    count: int


@dataclass(frozen=True, slots=True)
class Message:
    """A serialised message; `decode` deserialises it, `cdr` tells ROS 2 from ROS 1 bytes."""

    topic: str
    msgtype: str
    log_stamp: int
    raw: bytes
    cdr: bool
    decode: Callable[[], Any]


class BagFile(AbstractContextManager["BagFile"]):
    """An open recording: its topics and an iterator over messages in order of reception."""

    topics: list[Topic]
    begin: int = 0  # time of reception of the first message, ns
    end: int = 0  # and of the last

    def messages(self, names: Sequence[str]) -> Iterator[Message]:
        """Messages of the named topics in order of reception."""
        raise NotImplementedError

    def close(self) -> None:
        """Releases the file."""
        raise NotImplementedError

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _RosbagsFile(BagFile):
    """ROS 1 bags, ROS 2 directories and MCAP files with profile ros2, through rosbags."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._reader = AnyReader(list(paths))
        self._reader.open()
        self.begin, self.end = self._reader.start_time, self._reader.end_time
        connections = self._reader.connections
        names = sorted({c.topic for c in connections})
        self.topics = [
            Topic(
                name,
                next(c.msgtype for c in connections if c.topic == name),
                sum(c.msgcount for c in connections if c.topic == name),
            )
            for name in names
        ]

    def messages(self, names: Sequence[str]) -> Iterator[Message]:
        wanted = [c for c in self._reader.connections if c.topic in names]
        reader, cdr = self._reader, self._reader.is2
        for connection, stamp, raw in reader.messages(connections=wanted):
            msgtype = connection.msgtype
            yield Message(
                connection.topic,
                msgtype,
                stamp,
                bytes(raw),
                cdr,
                lambda raw=raw, msgtype=msgtype: reader.deserialize(raw, msgtype),
            )

    def close(self) -> None:
        self._reader.close()


def _is_ros1_mcap(path: Path) -> bool:
    """MCAP whose messages are ROS 1 serialised; rosbags reads only the ros2 profile."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(64)
    return head.startswith(MCAP_MAGIC) and b"ros2" not in head[:32]


def expand(path: Path) -> list[Path]:
    """The bag files meant by `path`: itself, or the .bag shards of a directory by name.

    Raises:
        DataError: nothing there.
    """
    if not path.exists():
        raise DataError(f"{path}: no such file or directory")
    if path.is_dir() and not (path / "metadata.yaml").exists():
        shards = sorted(path.glob("*.bag")) or sorted(path.glob("*.mcap"))
        if not shards:
            raise DataError(f"{path}: holds no .bag or .mcap file and no metadata.yaml")
        return shards
    return [path]


def open_bag(path: Path) -> BagFile:
    """Opens a recording.

    Raises:
        DataError: missing, empty, truncated, unindexed or of an unknown kind.
    """
    return open_files(expand(path), path)


def open_files(paths: Sequence[Path], path: Path) -> BagFile:
    """Opens files as one recording; `path` is what messages call it.

    Raises:
        DataError: as `open_bag`.
    """
    empty = [str(p) for p in paths if p.is_file() and p.stat().st_size == 0]
    if empty:
        raise DataError(f"{empty[0]}: the file is empty")
    try:
        if len(paths) == 1 and _is_ros1_mcap(paths[0]):
            from d2lio.datasets.mcap_ros1 import McapRos1File

            return McapRos1File(paths[0])
        return _RosbagsFile(paths)
    except DataError:
        raise
    except AnyReaderError as err:
        raise DataError(f"{path}: cannot be opened: {err}{_advice(str(err))}") from None
    except Exception as err:  # rosbags lets struct, assertion and codec errors through
        raise DataError(f"{path}: cannot be opened: {type(err).__name__}: {err}") from None


def _advice(reason: str) -> str:
    if "index" in reason.lower():
        return " (`rosbag reindex` repairs a recording that was cut off)"
    return ""


def topic_list(topics: Sequence[Topic]) -> str:
    """One line naming every topic with type and message count."""
    if not topics:
        return "no topics"
    return "; ".join(f"{t.name} ({t.msgtype}, {t.count})" for t in topics)
