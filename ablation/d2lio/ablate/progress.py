# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Says how far an ablation is: a live display on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping

from rich.console import Console
from rich.live import Live
from rich.markup import escape

from d2lio.ablate.cell import CellSpec, Outcome
from d2lio.ablate.plan import Group

SHOWN = 6  # of the jobs that run


class Estimate:
    """Time that is left, from the mean time of finished cells of the same variant."""

    def __init__(self) -> None:
        self._left: dict[str, int] = defaultdict(int)
        self._sequences_left = 0
        self._seconds: dict[str, list[float]] = defaultdict(list)
        self._made: list[float] = []

    def expect(self, variant: str) -> None:
        """One more cell to be done."""
        self._left[variant] += 1

    def expect_sequence(self) -> None:
        """One more sequence to be made."""
        self._sequences_left += 1

    def learn(self, variant: str, seconds: float | None) -> None:
        """What a cell took, be it in an earlier run of the suite."""
        if seconds is not None:
            self._seconds[variant].append(seconds)

    def done(self, variant: str, seconds: float | None) -> None:
        """A cell less."""
        self._left[variant] -= 1
        self.learn(variant, seconds)

    def made(self, seconds: float) -> None:
        """A sequence less; one that took no time was there already."""
        self._sequences_left -= 1
        if seconds > 0.0:
            self._made.append(seconds)

    def remaining_s(self, slots: int) -> float | None:
        """Seconds left on so many slots; None while nothing is known."""
        known = [s for values in self._seconds.values() for s in values]
        if not known:
            return None
        overall = sum(known) / len(known)
        total = 0.0
        for variant, count in self._left.items():
            values = self._seconds[variant]
            total += count * (sum(values) / len(values) if values else overall)
        if self._made:
            total += self._sequences_left * sum(self._made) / len(self._made)
        return total / max(1, slots)


class Display:
    """Writes to `console`; as a context manager, so that a live display ends in order."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, transient=True, auto_refresh=False)
        self._estimate = Estimate()
        self._running: dict[str, float] = {}
        self._total = self._done = self._failed = self._problems = 0
        self._slots = 1

    def __enter__(self) -> Display:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def begin(self, groups: list[Group], done: Mapping[str, Outcome], slots: int) -> None:
        """See `schedule.Watcher`."""
        self._slots = slots
        for group in groups:
            left = [cell for cell in group.cells if cell.directory not in done]
            for cell in left:
                self._estimate.expect(cell.variant)
            if left and group.origin.simulation is not None:
                self._estimate.expect_sequence()
            for cell in group.cells:
                if (outcome := done.get(cell.directory)) is not None:
                    self._estimate.learn(cell.variant, outcome.costs.process_s)
                    self._failed += outcome.scores.status != "ok"
            self._total += len(group.cells)
        self._done = len(done)
        if done:
            self._line(f"{len(done)} of {self._total} cells are done already")

    def started(self, label: str) -> None:
        """See `schedule.Watcher`."""
        self._running[label] = time.monotonic()
        self._refresh()

    def made(self, label: str, seconds: float) -> None:
        """See `schedule.Watcher`."""
        self._running.pop(label, None)
        self._estimate.made(seconds)
        self._refresh()

    def finished(self, spec: CellSpec, outcome: Outcome) -> None:
        """See `schedule.Watcher`."""
        self._running.pop(spec.label, None)
        self._done += 1
        self._failed += outcome.scores.status != "ok"
        self._estimate.done(spec.variant, outcome.costs.process_s)
        ate = outcome.scores.ate_m
        said = "" if ate is None else f"ATE {ate:.3f} m"
        if outcome.scores.status != "ok":
            said = f"FAIL: {outcome.scores.reason}"
        if not self._console.is_terminal:
            self._line(f"[{self._done}/{self._total}] {spec.label}: {said}; {self._left_text()}")
        self._refresh()

    def problem(self, label: str, reason: str) -> None:
        """See `schedule.Watcher`."""
        self._running.pop(label, None)
        self._problems += 1
        self._line(f"not carried out: {label}: {reason}")

    def tick(self, slots: int) -> None:
        """See `schedule.Watcher`."""
        self._slots = slots
        self._refresh()

    def _left_text(self) -> str:
        seconds = self._estimate.remaining_s(self._slots)
        if self._slots == 0:
            return "waiting for workers"
        return "time left unknown" if seconds is None else f"{_duration(seconds)} left"

    def _line(self, text: str) -> None:
        self._console.print(escape(text), highlight=False, soft_wrap=True)

    def _refresh(self) -> None:
        if not self._console.is_terminal:
            return
        now = time.monotonic()
        state = f"{self._done}/{self._total} cells"
        if self._failed:
            state += f", [red]{self._failed} failed[/]"
        if self._problems:
            state += f", [red]{self._problems} not carried out[/]"
        running = [f"{escape(k)} {now - since:.0f} s" for k, since in self._running.items()]
        more = f" and {len(running) - SHOWN} more" if len(running) > SHOWN else ""
        lines = [f"{state}, {self._left_text()}", *(f"  {text}" for text in running[:SHOWN])]
        self._live.update("\n".join(lines) + more, refresh=True)


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"
