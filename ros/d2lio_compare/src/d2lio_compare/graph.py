# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Questions to the ROS master and to nodes, from outside of any node."""

from __future__ import annotations

import socket
import subprocess
from contextlib import contextmanager
from typing import Any, Iterator
from xmlrpc.client import Error, ServerProxy

import rosgraph

CALLER = "/d2lio_compare"
TIMEOUT_S = 2.0
TROUBLE = (rosgraph.MasterException, Error, OSError)


@contextmanager
def _timeout() -> Iterator[None]:
    former = socket.getdefaulttimeout()
    socket.setdefaulttimeout(TIMEOUT_S)
    try:
        yield
    finally:
        socket.setdefaulttimeout(former)


def listening(nodes: list[str]) -> bool:
    """Whether all nodes are there and subscribe to something beside the clock."""
    try:
        with _timeout():
            _, subscribers, _ = rosgraph.Master(CALLER).getSystemState()
    except TROUBLE:
        return False
    there = {node for topic, names in subscribers if topic != "/clock" for node in names}
    return all(node in there for node in nodes)


def connected(player: str, topics: list[str]) -> bool:
    """Whether everybody who subscribes to the topics is connected to the player."""
    try:
        with _timeout():
            master = rosgraph.Master(CALLER)
            _, subscribers, _ = master.getSystemState()
            code, _, links = ServerProxy(master.lookupNode(player)).getBusInfo(CALLER)
    except TROUBLE:
        return False
    wanted = {(topic, node) for topic, names in subscribers for node in names if topic in topics}
    return code == 1 and wanted <= {(link[4], link[1]) for link in links}


def resume(player: str) -> bool:
    """Lets a paused player go on."""
    command = ["rosservice", "call", f"{player}/pause_playback", "data: false"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=10.0, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and b"success: True" in done.stdout


def set_param(name: str, value: Any) -> None:
    """Sets a parameter, if there is a master."""
    try:
        with _timeout():
            rosgraph.Master(CALLER).setParam(name, value)
    except TROUBLE:
        pass


def get_param(name: str) -> Any:
    """A parameter, None where it is not set."""
    try:
        with _timeout():
            return rosgraph.Master(CALLER).getParam(name)
    except TROUBLE:
        return None
