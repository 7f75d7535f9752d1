# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Which nodes are gone: a killed one stays registered at the master, but answers no more."""

from __future__ import annotations

import socket
import time
from urllib.parse import urlparse

import rosgraph

PERIOD_S = 2.0
TIMEOUT_S = 1.0
START_UP_S = 30.0  # a node that never registered is dead after that
MISSES = 2  # in a row


class Liveness:
    """Looks at every node once in PERIOD_S."""

    def __init__(self, names: list[str]) -> None:
        self._misses = dict.fromkeys(names, 0)
        self._seen: set[str] = set()
        self._begun = time.monotonic()
        self._looked = -PERIOD_S

    def dead(self, at_once: bool = False) -> set[str]:
        """Names of the nodes that are gone; `at_once`: looks as often as it takes to be sure."""
        for _ in range(MISSES if at_once else 1):
            now = time.monotonic()
            if at_once or now - self._looked >= PERIOD_S:
                self._looked = now
                for name in self._misses:
                    self._look(name, now)
        return {name for name, misses in self._misses.items() if misses >= MISSES}

    def _look(self, name: str, now: float) -> None:
        if _answers(name):
            self._seen.add(name)
            self._misses[name] = 0
        elif name in self._seen or now - self._begun > START_UP_S:
            self._misses[name] += 1


def _answers(name: str) -> bool:
    try:
        uri = rosgraph.Master("/scoreboard").lookupNode(name)
    except (rosgraph.MasterException, OSError):
        return False
    address = urlparse(uri)
    try:
        socket.create_connection((address.hostname, address.port), TIMEOUT_S).close()
    except OSError:
        return False
    return True
