# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""docs/PARAMETERS.md is what the command prints."""

from __future__ import annotations

from pathlib import Path

import pytest
from d2lio.hosts import HOSTS, describe, liosam_missing
from d2lio.params import to_markdown

PAGE = Path(__file__).parents[2] / "docs" / "PARAMETERS.md"


def entry(key: str, default: str, unit: str = "m") -> dict[str, str]:
    return {
        "key": key, "type": "float", "default": default, "range": ">= 0", "unit": unit, "doc": "x",
    }  # fmt: skip


@pytest.mark.skipif(liosam_missing() is not None, reason="built without GTSAM")
def test_the_parameter_page_is_up_to_date() -> None:
    expected = to_markdown({host: describe(host) for host in HOSTS}).strip()
    assert PAGE.read_text(encoding="utf-8").strip() == expected, (
        "run: ./d2lio params --markdown --host all > docs/PARAMETERS.md"
    )


def test_the_page_holds_every_parameter_of_the_fast_lio_host() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert [e["key"] for e in describe("fastlio") if f"| `{e['key']}` |" not in page] == []


def test_parameters_that_hosts_share_are_said_once() -> None:
    page = to_markdown(
        {
            "fastlio": [entry("a.x", "1"), entry("b", "2"), entry("c", "3", "s")],
            "liosam": [entry("a.x", "1"), entry("c", "3")],
            "d2lio": [entry("a.x", "4"), entry("c", "3")],
        }
    )
    assert page.count("`a.x`") == page.count("`b`") == 1
    assert "1 (fastlio, liosam); 4 (d2lio)" in page
    assert page.count("| `c` |") == 2  # another unit is another parameter
    titles = [line for line in page.splitlines() if line.startswith("## ")]
    assert titles[0] == "## All hosts"
    assert any("LIO-SAM host (`liosam`), D²-LIO (`d2lio`)" in title for title in titles)
