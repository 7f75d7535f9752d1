# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tiny suites and the processes that carry them out."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # plugin_hosts and the other helpers of these tests

ROOM_S = 4.0


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated sequence of four seconds."""
    from d2lio.simulator import simulate

    path = tmp_path_factory.mktemp("room") / "room"
    simulate("room", path, duration=ROOM_S)
    return path


@pytest.fixture
def plugin_hosts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The estimators of plugin_hosts.py, here and in the processes of runs."""
    from d2lio import hosts
    from d2lio.ablate.execute import close_slots

    before = dict(hosts.HOSTS)
    paths = [str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    monkeypatch.setenv("D2LIO_PLUGINS", "plugin_hosts")
    close_slots()
    yield
    close_slots()
    sys.modules.pop("plugin_hosts", None)
    hosts.HOSTS.clear()
    hosts.HOSTS.update(before)
