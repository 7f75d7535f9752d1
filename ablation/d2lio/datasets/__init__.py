# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Readers of recorded data: bags, KITTI, Ouster captures."""

from d2lio.datasets.config import SourceConfig
from d2lio.datasets.events import ImuBlock, Notes, RawScan, Reader, Scan, TimeHint
from d2lio.datasets.source import Source, open_source
from d2lio.datasets.timing import TimeResolver, timed_events

__all__ = [
    "ImuBlock",
    "Notes",
    "RawScan",
    "Reader",
    "Scan",
    "Source",
    "SourceConfig",
    "TimeHint",
    "TimeResolver",
    "open_source",
    "timed_events",
]
