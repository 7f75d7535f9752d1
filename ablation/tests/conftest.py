# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Shared fixtures; real recordings are looked for beside the repository."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
sys.path.insert(0, str(TESTS))  # fakes and bags, for tests only


def shared_folder() -> Path:
    """Folder with real data: $D2LIO_SHARED or ../shared beside the repository."""
    given = os.environ.get("D2LIO_SHARED")
    return Path(given) if given else TESTS.parents[1].parent / "shared"


@pytest.fixture
def real_data():
    """A function giving the path of a real recording, skipping the test where it is absent."""

    def find(name: str) -> Path:
        path = shared_folder() / "data" / name
        if not path.exists():
            pytest.skip(f"real data absent: {path} (set D2LIO_SHARED)")
        return path

    return find


@pytest.fixture
def fake_host(monkeypatch: pytest.MonkeyPatch):
    """The host name `fake`, driving FakeHost."""
    from d2lio import hosts
    from fakes import FakeHost

    monkeypatch.setitem(hosts.HOSTS, "fake", lambda: FakeHost)
    return "fake"
