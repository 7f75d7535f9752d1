# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The launch file of the variants: roslaunch's XML has no loops, so it is written for each call."""

from __future__ import annotations

import json
from typing import Any, NamedTuple
from xml.etree import ElementTree

from d2lio_compare import upstream
from d2lio_compare.shared.names import Variant

NODE_NAME = "d2lio"
SCOREBOARD = "scoreboard"
PLAYER = "/player"
PACKAGES = {"fastlio": "d2lio_fastlio", "liosam": "d2lio_liosam", "d2lio": "d2lio_liosam"}
NODES = "nodes"  # below the output directory: what the nodes save, one directory each


def node_of(variant: Variant) -> str:
    """Full name of the node that gives a variant's odometry."""
    return f"/{variant.id}/{upstream.NODES.get(variant.upstream, NODE_NAME)}"


class Setting(NamedTuple):
    """What all variants have in common.

    Attributes:
        out: output directory, absolute.
        config: data description of the recording, empty for none; description: its content.
        truth_file, truth_topic: at most one is not empty.
        sim_time: whether a bag's clock is used.
    """

    out: str
    config: str
    description: dict[str, Any]
    truth_file: str
    truth_topic: str
    lidar_topic: str
    imu_topic: str
    lidar_type: str
    threads: int
    queue_scans: int
    sim_time: bool


def write(variants: list[Variant], setting: Setting) -> str:
    """The launch file as text."""
    root = ElementTree.Element("launch")
    if setting.sim_time:
        _param(root, "/use_sim_time", "true", "bool")
    for variant in variants:
        group = ElementTree.SubElement(root, "group", ns=variant.id)
        if variant.upstream:
            topics = setting.lidar_topic, setting.imu_topic
            upstream.add(group, variant.upstream, *topics, setting.description)
        else:
            _own_node(group, variant, setting)
    _scoreboard(root, variants, setting)
    _indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _param(parent: ElementTree.Element, name: str, value: object, kind: str = "str") -> None:
    attributes = {"name": name, "value": str(value), "type": kind}
    ElementTree.SubElement(parent, "param", attributes)


def _node(parent: ElementTree.Element, package: str, kind: str, name: str) -> ElementTree.Element:
    """A node that knows nothing of what an earlier comparison left at the same master."""
    attributes = {"pkg": package, "type": kind, "name": name}
    return ElementTree.SubElement(
        parent, "node", {**attributes, "output": "screen", "clear_params": "true"}
    )


def _own_node(group: ElementTree.Element, variant: Variant, setting: Setting) -> None:
    package = PACKAGES[variant.host]
    node = _node(group, package, package, NODE_NAME)
    if package == "d2lio_liosam":
        _param(node, "estimator", variant.host)
    for key, value in _topics(setting):
        _param(node, key, value)
    if setting.config:
        _param(node, "sequence_config", setting.config)
    _param(node, "map_frame", "map")
    _param(node, "body_frame", f"{variant.id}/imu")
    _param(node, "queue_scans", setting.queue_scans, "int")
    _param(node, "threads", setting.threads, "int")
    _param(node, "save_dir", f"{setting.out}/{NODES}")
    _param(node, "results_name", variant.id)
    _param(node, "rejection/mode", variant.rejection)
    _param(node, "degeneracy/method", variant.degeneracy)


def _topics(setting: Setting) -> list[tuple[str, str]]:
    pairs = [
        ("lidar_topic", setting.lidar_topic),
        ("imu_topic", setting.imu_topic),
        ("lidar_type", setting.lidar_type),
    ]
    return [(key, value) for key, value in pairs if value]


def _scoreboard(root: ElementTree.Element, variants: list[Variant], setting: Setting) -> None:
    node = _node(root, "d2lio_compare", "scoreboard.py", SCOREBOARD)
    _param(node, "out", setting.out)
    _param(node, "truth_file", setting.truth_file)
    _param(node, "truth_topic", setting.truth_topic)
    _param(node, "config", setting.config)
    text = ElementTree.SubElement(node, "rosparam", param="variants")
    text.text = json.dumps([dict(variant._asdict()) for variant in variants])


def _indent(element: ElementTree.Element, level: int = 0) -> None:
    """ElementTree.indent, which Python 3.8 lacks."""
    pad = "\n" + "  " * level
    if len(element):
        if not (element.text or "").strip():
            element.text = pad + "  "
        for child in element:
            _indent(child, level + 1)
            child.tail = pad + "  "
        element[-1].tail = pad
