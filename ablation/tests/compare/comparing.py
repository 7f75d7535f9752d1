# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of comparisons share."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from d2lio.ablate.results import Results


class Quiet:
    """A watcher that says nothing."""

    def begin(self, groups: object, done: object, slots: int) -> None: ...

    def started(self, label: str) -> None: ...

    def made(self, label: str, seconds: float) -> None: ...

    def finished(self, spec: object, outcome: object) -> None: ...

    def problem(self, label: str, reason: str) -> None: ...

    def tick(self, slots: int) -> None: ...


class Compared(NamedTuple):
    """A comparison that was carried out."""

    sequence: Path
    results: Results
