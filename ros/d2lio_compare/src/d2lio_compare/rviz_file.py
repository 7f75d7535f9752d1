# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The RViz layout of a comparison: every variant in its colour of the report."""

from __future__ import annotations

from typing import Any

import yaml

from d2lio_compare.shared.names import TRUTH_COLOUR, Variant, rgb

WIDTH, HEIGHT = 1600, 900
TRUTH_TOPIC = "/truth/path"
LABELS_TOPIC = "/scoreboard/labels"
MARKERS_TOPIC = "compare_markers"  # of each variant, in its colour


def write(variants: list[Variant]) -> str:
    """The layout as YAML."""
    displays = [
        {"Class": "rviz/Grid", "Name": "Grid", "Enabled": True, "Cell Size": 5, "Alpha": 0.3,
         "Plane Cell Count": 40},
        _path("Ground truth", TRUTH_TOPIC, TRUTH_COLOUR, 0.06),
        _markers("Scoreboard", LABELS_TOPIC, True),
        *(_group(variant) for variant in variants),
    ]  # fmt: skip
    layout = {
        "Panels": [{"Class": "rviz/Displays", "Name": "Displays"}],
        "Visualization Manager": {
            "Class": "",
            "Displays": displays,
            "Enabled": True,
            "Global Options": {
                "Background Color": "16; 18; 22", "Fixed Frame": "map", "Frame Rate": 15,
            },
            "Name": "root",
            "Tools": [{"Class": "rviz/MoveCamera"}, {"Class": "rviz/Measure"}],
            "Value": True,
            "Views": {"Current": _camera(variants[0])},
        },
        "Window Geometry": {
            "Displays": {"collapsed": False}, "Width": WIDTH, "Height": HEIGHT, "X": 0, "Y": 0,
        },
    }  # fmt: skip
    return yaml.safe_dump(layout, sort_keys=False)


def _colour(text: str) -> str:
    return "; ".join(str(part) for part in rgb(text))


def _camera(variant: Variant) -> dict[str, Any]:
    """It goes along with a variant; an upstream node's frame is not known."""
    frame = "map" if variant.upstream else f"{variant.id}/imu"
    return {
        "Class": "rviz/Orbit",
        "Name": "Current View",
        "Distance": 30,
        "Pitch": 0.9,
        "Yaw": 3.9,
        "Target Frame": frame,
        "Value": "Orbit (rviz)",
        "Focal Point": {"X": 0, "Y": 0, "Z": 0},
    }


def _group(variant: Variant) -> dict[str, Any]:
    """Displays of one variant."""
    ns = f"/{variant.id}"
    return {
        "Class": "rviz/Group",
        "Name": variant.title,
        "Enabled": True,
        "Displays": [
            _path("Path", f"{ns}/path", variant.colour, 0.05),
            _cloud("Registered cloud", f"{ns}/cloud_registered", variant.colour, True),
            _markers("Weak directions", f"{ns}/{MARKERS_TOPIC}", True),
            _cloud("Rejected points", f"{ns}/rejected", "", False),
        ],
    }


def _path(name: str, topic: str, colour: str, width: float) -> dict[str, Any]:
    return {
        "Class": "rviz/Path",
        "Name": name,
        "Enabled": True,
        "Value": True,
        "Topic": topic,
        "Color": _colour(colour),
        "Line Style": "Billboards",
        "Line Width": width,
        "Queue Size": 10,
    }


def _cloud(name: str, topic: str, colour: str, enabled: bool) -> dict[str, Any]:
    """Without a colour: that of the points themselves."""
    return {
        "Class": "rviz/PointCloud2",
        "Name": name,
        "Enabled": enabled,
        "Value": enabled,
        "Topic": topic,
        "Color": _colour(colour) if colour else "255; 255; 255",
        "Color Transformer": "FlatColor" if colour else "RGB8",
        "Style": "Points",
        "Size (Pixels)": 2,
        "Alpha": 0.6,
        "Decay Time": 0,
        "Queue Size": 5,
    }


def _markers(name: str, topic: str, enabled: bool) -> dict[str, Any]:
    return {
        "Class": "rviz/MarkerArray",
        "Name": name,
        "Enabled": enabled,
        "Value": enabled,
        "Marker Topic": topic,
        "Queue Size": 10,
    }
