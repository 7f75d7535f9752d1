# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""One short simulated sequence and one comparison on it, shared by the tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # comparing.py

from comparing import Compared, Quiet  # noqa: E402

ROOM_S = 5.0
VARIANTS = "off,d2"


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from d2lio.simulator import simulate

    path = tmp_path_factory.mktemp("compare_room") / "room"
    simulate("room", path, duration=ROOM_S)
    return path


@pytest.fixture(scope="session")
def compared(room: Path, tmp_path_factory: pytest.TempPathFactory) -> Compared:
    from d2lio.compare.material import find_material
    from d2lio.compare.offline import CompareOptions, compare
    from d2lio.compare.variants import parse

    out = tmp_path_factory.mktemp("compared") / "out"
    material = find_material(str(room), out)
    ablation = compare(material, parse(VARIANTS), out, CompareOptions(), Quiet())
    assert ablation.problems == {}
    return Compared(room, ablation.results)
