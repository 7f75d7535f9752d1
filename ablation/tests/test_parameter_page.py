# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""docs/PARAMETERS.md is what the command prints."""

from __future__ import annotations

from pathlib import Path

from d2lio.hosts import describe
from d2lio.params import to_markdown

PAGE = Path(__file__).parents[2] / "docs" / "PARAMETERS.md"


def test_the_parameter_page_is_up_to_date() -> None:
    expected = to_markdown("fastlio", describe("fastlio")).strip()
    assert PAGE.read_text(encoding="utf-8").strip() == expected, (
        "run: ./d2lio params --markdown > docs/PARAMETERS.md"
    )
