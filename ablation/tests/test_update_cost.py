# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How the time of updates is compared: by scan, the quickest run of each."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from built import host_params
from d2lio import update_cost
from d2lio.datasets import Source
from d2lio.errors import DataError
from d2lio.update_cost import Cost, compare

SOURCE = cast(Source, SimpleNamespace(name="drive"))


def result(stamp: int, search: float, iterations: int) -> SimpleNamespace:
    """What a host says of a scan; its update takes 1 ms beside the search."""
    figures = {"time_search_ms": search, "time_update_ms": 1.0, "iterations": iterations}
    return SimpleNamespace(stamp=stamp, diagnostics=figures)


def test_quickest_run_of_each_scan_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {
        "none": iter([[(1, 9.0), (2, 3.0), (3, 5.0)], [(1, 9.0), (2, 5.0), (3, 3.0)]]),
        "noise_aware": iter([[(2, 2.0), (3, 9.0)], [(2, 9.0), (3, 4.0)]]),
    }

    def scans(source: Source, host: str, rejection: str | None, method: str) -> Iterator[Any]:
        iterations = 4 if method == "none" else 2
        yield from (result(stamp, ms, iterations) for stamp, ms in next(runs[method]))

    monkeypatch.setattr(update_cost, "scans", scans)
    cost = compare(SOURCE, "room", "fastlio", 2)
    assert cost == Cost("room", "fastlio", 4.0, 4.0, 4.0, 2.0)  # the first scan is not of both
    assert cost.percent == 0.0


def test_a_host_without_a_pose_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(update_cost, "scans", lambda *_: iter(()))
    with pytest.raises(DataError, match="drive: fastlio gave no pose"):
        compare(SOURCE, "room", "fastlio", 1)


@pytest.mark.parametrize("host", host_params(("fastlio", "d2lio")))
def test_a_short_room_has_its_row(host: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = f"--scenes room --hosts {host} --repeats 1 --duration 6"
    assert update_cost.main(arguments.split()) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if host in line]
    assert len(rows) == 1
    base, ours = (float(cell) for cell in rows[0].replace("│", " ").split()[2:4])
    assert min(base, ours) > 0.0


@pytest.mark.parametrize("arguments", ["--repeats 0", "--hosts liosam", "--seeds 0"])
def test_wrong_arguments_are_refused(arguments: str) -> None:
    with pytest.raises(SystemExit):
        update_cost.main(arguments.split())
