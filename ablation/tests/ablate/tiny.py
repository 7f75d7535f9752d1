# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A suite that runs in seconds, and a watcher that remembers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from d2lio.ablate.cell import CellSpec, Outcome
from d2lio.ablate.plan import Group
from d2lio.ablate.suite import Suite

ROOM = {"scene": "room", "duration": 4}
FASTLIO = {"id": "fastlio", "host": "fastlio", "rejection": "off"}
ADAPTIVE = {"id": "adaptive", "host": "fastlio", "rejection": "point_adaptive"}


def data(**changes: Any) -> dict[str, Any]:
    """Nested mappings of a suite: two sequences, two variants, two repeats; eight cells."""
    return {
        "name": "tiny",
        "repeats": 2,
        "limits": {"time_s": 120},
        "baseline": "fastlio",
        "sequences": [
            {"name": "First Room", "dataset": "made", "simulate": ROOM},
            {"name": "Second", "simulate": {**ROOM, "seed_base": 7, "duration": 3}},
        ],
        "variants": [FASTLIO, ADAPTIVE],
    } | changes


def suite(**changes: Any) -> Suite:
    return Suite.parse(data(**changes))


class Memory:
    """A watcher; `on_started` is called with the number of jobs started so far."""

    def __init__(self, on_started: Callable[[int], None] | None = None) -> None:
        self.labels: list[str] = []
        self.done: list[str] = []
        self.made_labels: list[str] = []
        self.problems: list[str] = []
        self.before: list[str] = []
        self._on_started = on_started

    def begin(self, groups: list[Group], done: Mapping[str, Outcome], slots: int) -> None:
        self.before = list(done)

    def started(self, label: str) -> None:
        self.labels.append(label)
        if self._on_started is not None:
            self._on_started(len(self.labels))

    def made(self, label: str, seconds: float) -> None:
        self.made_labels.append(label)

    def finished(self, spec: CellSpec, outcome: Outcome) -> None:
        self.done.append(spec.label)

    def problem(self, label: str, reason: str) -> None:
        self.problems.append(f"{label}: {reason}")

    def tick(self, slots: int) -> None:
        pass
