# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the user reads: the list of insertions, the diff, and what to do next."""

from __future__ import annotations

import difflib
import os
import shlex
from collections.abc import Iterator
from pathlib import Path

from d2lio_patch.hosts import Host
from d2lio_patch.plan import FilePlan, Plan

_YAML = """\
d2lio:
  rejection:
    mode: point_adaptive  # off (upstream), none, fixed, kiss, point_adaptive
  degeneracy:
    method: none          # none, paper, remap, tsvd; xicp, noise_aware in FAST_LIO
"""


def listing(plan: Plan) -> str:
    """Every insertion: file, line, name, what for."""
    lines = []
    for file in plan.files:
        lines.append(f"{file.path}")
        for insertion in (i for i in plan.insertions if i.path == file.path):
            hook = insertion.hook
            lines.append(f"  line {insertion.site.line:>5}  {hook.name}: {hook.what}")
            lines.append(f"              why: {hook.why}")
            lines.append(f"              test: {hook.test}")
    return "\n".join(lines)


def summary(files: list[FilePlan]) -> str:
    """How many lines come into (or go out of) which file."""
    lines = []
    for file in files:
        change = file.wanted.count(b"\n") - file.current.count(b"\n")
        lines.append(f"  {file.path}: {change:+d} lines")
    return "\n".join(lines)


def diff(files: list[FilePlan]) -> bytes:
    """Unified diff that ``git apply`` and ``patch -p1`` take."""
    return b"".join(line for file in files if file.changes for line in _file_diff(file))


def _file_diff(file: FilePlan) -> Iterator[bytes]:
    name = os.fsencode(file.path)
    for line in difflib.diff_bytes(
        difflib.unified_diff, _lines(file.current), _lines(file.wanted), b"a/" + name, b"b/" + name
    ):
        yield line if line.endswith(b"\n") else line + b"\n\\ No newline at end of file\n"


def _lines(data: bytes) -> list[bytes]:
    """Cuts behind line feeds only: a lone carriage return is part of its line."""
    parts = data.split(b"\n")
    return [part + b"\n" for part in parts[:-1]] + ([parts[-1]] if parts[-1] else [])


def next_steps(host: Host) -> str:
    """The rebuild command and the YAML block."""
    workspace, builder = _workspace(host)
    yaml = _YAML
    where = "the YAML file that your launch file loads"
    if host.flavour == "ros2":
        inner = "".join("    " + line + "\n" for line in _YAML.splitlines())
        yaml = "/**:\n  ros__parameters:\n" + inner
    return f"next:\n  cd {shlex.quote(str(workspace))} && {builder}\nand in {where}:\n\n" + "".join(
        f"  {line}\n" for line in yaml.splitlines()
    )


def _workspace(host: Host) -> tuple[Path, str]:
    package = shlex.quote(host.package)
    if host.flavour == "ros2":
        command = f"colcon build --packages-select {package}"
    else:
        command = "catkin_make"
    for folder in host.root.parents:
        if (folder / ".catkin_tools").exists():
            return folder, f"catkin build {package}"
        if (folder / "src") in (host.root, *host.root.parents):
            return folder, command
    return host.root.parent, command
