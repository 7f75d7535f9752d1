# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The scoreboard's lines and texts."""

from __future__ import annotations

import pytest
from d2lio.compare.shared.board import Counts, Line, markdown, plain

ROW = {"status": "ok", "health": "OK", "offered": "100", "accepted": "80", "lambda_t_1": "7.5"}


def test_counts_sum_up_what_the_diagnostics_say() -> None:
    counts = Counts()
    for number, time in enumerate(["4.0", "8.0", "5.0", "nan"]):
        counts.add(ROW | {"time_total_ms": time, "health": "DEGENERATE" if number else "INIT"})
    counts.add(ROW | {"status": "skipped", "time_total_ms": "0.0", "offered": "0"})
    line = counts.line("a", "", 0.25)
    assert line == Line("a", "DEGENERATE", 4, 0.25, 7.5, pytest.approx(0.2), 5.0)


def test_before_the_first_scan_nothing_is_known() -> None:
    assert Counts().line("a", "", None) == Line("a", "waiting", 0, None, None, None, None)


def test_texts_have_one_line_per_variant_and_dashes_where_nothing_is_known() -> None:
    lines = [Line("off", "OK", 12, 0.1234, 3.21, 0.25, 9.96), Line("x", "DEAD", 0, *[None] * 4)]
    text = plain(lines).splitlines()
    assert len(text) == 3
    assert text[1].split() == ["off", "OK", "12", "0.123", "3.2", "25.0", "%", "10.0"]
    assert text[2].split() == ["x", "DEAD", "0", "-", "-", "-", "-"]
    assert markdown(lines).splitlines()[2] == "| off | OK | 12 | 0.123 | 3.2 | 25.0 % | 10.0 |"
