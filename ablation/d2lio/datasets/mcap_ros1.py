# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""MCAP files with ROS 1 serialised messages (schema and message encoding ros1msg, ros1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from d2lio.datasets.bagfile import BagFile, Message, Topic
from d2lio.errors import DataError


def _long_name(name: str) -> str:
    return name if "/msg/" in name else name.replace("/", "/msg/")


class McapRos1File(BagFile):
    """Reads through the mcap package and deserialises with rosbags' ROS 1 types."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stream = path.open("rb")
        try:
            self._open()
        except BaseException:
            self._stream.close()
            raise

    def _open(self) -> None:
        self._reader = make_reader(self._stream)
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise DataError(f"{self._path}: has no index (the recording was cut off)")
        encodings = {c.message_encoding for c in summary.channels.values()}
        if encodings - {"ros1"}:
            raise DataError(f"{self._path}: message encodings {sorted(encodings)}, expected ros1")
        self.begin = summary.statistics.message_start_time
        self.end = summary.statistics.message_end_time
        counts = summary.statistics.channel_message_counts
        self._store = get_typestore(Stores.EMPTY)
        types: dict = {}
        for schema in summary.schemas.values():
            types.update(get_types_from_msg(schema.data.decode(), _long_name(schema.name)))
        self._store.register(types)
        totals: dict[tuple[str, str], int] = {}
        for key, channel in summary.channels.items():
            name = (channel.topic, _long_name(summary.schemas[channel.schema_id].name))
            totals[name] = totals.get(name, 0) + counts.get(key, 0)
        self.topics = [Topic(t, m, n) for (t, m), n in sorted(totals.items())]

    def messages(self, names: Sequence[str]) -> Iterator[Message]:
        """Messages of the named topics in order of reception."""
        store = self._store
        for schema, channel, message in self._reader.iter_messages(topics=list(names)):
            msgtype = _long_name(schema.name)
            yield Message(
                channel.topic,
                msgtype,
                message.log_time,
                message.data,
                False,
                lambda raw=message.data, msgtype=msgtype: store.deserialize_ros1(raw, msgtype),
            )

    def close(self) -> None:
        """Releases the file."""
        self._stream.close()
