# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The scoreboard as text."""

from __future__ import annotations

import math
from typing import NamedTuple, Sequence

HEADERS = ("variant", "state", "scans", "APE m", "lambda_min", "rejected", "ms/scan")


class Line(NamedTuple):
    """What is known of a variant now; None where it is not.

    Attributes:
        state: health of the last scan, or DEAD, FAIL, waiting.
        ape: m; lambda_min: smallest eigenvalue of the translation block; rejected: share so far,
            [0, 1]; ms: median per scan so far.
    """

    title: str
    state: str
    scans: int
    ape: float | None
    lambda_min: float | None
    rejected: float | None
    ms: float | None


class Counts:
    """Diagnostics of one variant, scan by scan, summed up."""

    def __init__(self) -> None:
        self.scans = 0
        self.health = "waiting"
        self.lambda_min: float | None = None
        self._offered = self._accepted = 0.0
        self._times: list[float] = []

    def add(self, row: dict[str, str]) -> None:
        """One row of diagnostics.csv. Scans that a host skips on purpose do not count."""
        if row.get("status") == "skipped":
            return
        self.scans += 1
        self.health = row.get("health", "") or "-"
        self.lambda_min = number(row.get("lambda_t_1"))
        self._offered += number(row.get("offered")) or 0.0
        self._accepted += number(row.get("accepted")) or 0.0
        time = number(row.get("time_total_ms"))
        if time is not None:
            self._times.append(time)

    @property
    def rejected(self) -> float | None:
        """Share of the correspondences that were rejected so far."""
        return 1.0 - self._accepted / self._offered if self._offered > 0.0 else None

    @property
    def ms(self) -> float | None:
        """Median time per scan, ms."""
        times = sorted(self._times)
        middle = len(times) // 2
        if not times:
            return None
        return times[middle] if len(times) % 2 else 0.5 * (times[middle - 1] + times[middle])

    def line(self, title: str, state: str, ape: float | None, poses: int = 0) -> Line:
        """The variant's line; an empty `state` is the last scan's health.

        `poses` tell of one that gives no diagnostics, as an upstream node.
        """
        scans, health = self.scans, self.health
        if scans == 0 and poses > 0:
            scans, health = poses, "-"
        return Line(title, state or health, scans, ape, self.lambda_min, self.rejected, self.ms)


def number(text: object) -> float | None:
    """A finite number, or None."""
    try:
        value = float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None
    return value if math.isfinite(value) else None


def cells(line: Line) -> list[str]:
    """The texts of a line, by HEADERS."""
    return [
        line.title,
        line.state,
        str(line.scans),
        _text(line.ape, "{:.3f}"),
        _text(line.lambda_min, "{:.1f}"),
        _text(None if line.rejected is None else 100.0 * line.rejected, "{:.1f} %"),
        _text(line.ms, "{:.1f}"),
    ]


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def plain(lines: Sequence[Line]) -> str:
    """A table in plain text, one line per variant."""
    rows = [list(HEADERS), *(cells(line) for line in lines)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADERS))]
    return "\n".join(
        "  ".join(c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths)))
        for row in rows
    )


def markdown(lines: Sequence[Line]) -> str:
    """The same in Markdown."""
    rule = [":--", ":--", *["--:"] * (len(HEADERS) - 2)]
    rows = [list(HEADERS), rule, *(cells(line) for line in lines)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
