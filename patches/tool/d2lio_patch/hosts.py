# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Recognises what kind of checkout a folder is."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from d2lio_patch.errors import E_HOST, PatchError
from d2lio_patch.source import Source

_BUILD_TOOL = re.compile(r"<buildtool_depend>\s*(catkin|ament_cmake)\w*\s*<")
_PACKAGE = re.compile(r"<name>\s*([\w.-]+)\s*</name>")
_SUGGESTION_DEPTH = 3


@dataclass(frozen=True)
class Kind:
    """A supported host: its folder under patches/, its name, and what gives it away."""

    key: str
    title: str
    sources: tuple[str, ...]
    needs: tuple[str, ...]


KINDS = (
    Kind("fast_lio", "FAST_LIO", ("src/laserMapping.cpp",), ("h_share_model", "ikdtree")),
    Kind(
        "lio_sam",
        "LIO-SAM",
        ("src/mapOptmization.cpp", "src/mapOptimization.cpp"),
        ("LMOptimization", "scan2MapOptimization"),
    ),
)


@dataclass(frozen=True)
class Host:
    """A recognised checkout.

    Attributes:
        root: its folder, absolute, symbolic links resolved.
        kind: FAST_LIO or LIO-SAM.
        flavour: ros1 or ros2.
        package: the ROS package's name.
    """

    root: Path
    kind: Kind
    flavour: str
    package: str

    @property
    def title(self) -> str:
        """For messages."""
        return f"{self.kind.title} (ROS {self.flavour[-1]})"


def recognise(folder: str | os.PathLike[str]) -> Host:
    """Recognises a checkout.

    Raises:
        PatchError: it is not one that can be patched; the message says why and what to try.
    """
    given = Path(folder)
    if not given.is_dir():
        raise PatchError(E_HOST, f"{given}: not a folder" if given.exists() else f"{given}: absent")
    root = given.resolve()
    if "\n" in str(root):
        raise PatchError(E_HOST, "a path with a line break in it cannot be written into CMake")
    package_file = root / "package.xml"
    if not package_file.is_file():
        raise PatchError(E_HOST, f"{given}: not a ROS package (no package.xml){_suggest(root)}")
    xml = Source.from_bytes("package.xml", package_file.read_bytes()).code
    name = _PACKAGE.search(xml)
    package = name[1] if name else root.name
    kind = next((kind for kind in KINDS if _is_kind(root, kind)), None)
    if kind is None:
        raise PatchError(
            E_HOST, f"{given}: package '{package}' is neither FAST_LIO nor LIO-SAM{_suggest(root)}"
        )
    return Host(root, kind, _flavour(root, given, kind, xml), package)


def _is_kind(root: Path, kind: Kind) -> bool:
    for name in kind.sources:
        if (root / name).is_file():
            code = Source.from_bytes(name, (root / name).read_bytes()).code
            return all(re.search(rf"\b{word}\b", code) for word in kind.needs)
    return False


def _flavour(root: Path, given: Path, kind: Kind, xml: str) -> str:
    tool = _BUILD_TOOL.search(xml)
    if tool is None:
        raise PatchError(E_HOST, f"{given}: package.xml names neither catkin nor ament_cmake")
    flavour = "ros1" if tool[1] == "catkin" else "ros2"
    name = next(name for name in kind.sources if (root / name).is_file())
    text = (root / name).read_text(encoding="latin-1")
    speaks_ros2 = bool(re.search(r"\b(rclcpp|sensor_msgs::msg)\b", text))
    if speaks_ros2 != (flavour == "ros2"):
        other = "ROS 2" if speaks_ros2 else "ROS 1"
        raise PatchError(E_HOST, f"{given}: package.xml is for {tool[1]}, but {name} for {other}")
    return flavour


def _suggest(root: Path) -> str:
    """Names a checkout further down, for who gave the workspace instead."""
    found = []
    for folder, subfolders, _ in os.walk(root):
        depth = len(Path(folder).relative_to(root).parts)
        hidden = [name for name in subfolders if name.startswith(".")]
        for name in hidden if depth < _SUGGESTION_DEPTH else list(subfolders):
            subfolders.remove(name)
        if depth > 0 and any(_is_kind(Path(folder), kind) for kind in KINDS):
            found.append(folder)
            subfolders.clear()
    return f"\ndid you mean {found[0]} ?" if found else ""
