# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What git says about the files that are to be changed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

_TIME_LIMIT_S = 60


def compare_with_commit(root: Path, paths: list[str]) -> dict[str, bool]:
    """For each path that git knows: whether it differs from the last commit.

    Empty where there is no git, no repository or no commit: there is nothing to compare with.

    Args:
        root: the checkout; may lie inside a larger repository.
        paths: relative to it.
    """
    if not paths or shutil.which("git") is None:
        return {}
    tracked = _git(root, "ls-files", "-z", "--", *paths)
    # diff, other than diff-index, looks at the contents of a file that was merely touched.
    differing = _git(
        root, "diff", "--name-only", "--no-ext-diff", "--relative", "-z", "HEAD", "--", *paths
    )
    if tracked is None or differing is None:
        return {}
    return {path: path in differing for path in tracked}


def _git(root: Path, *arguments: str) -> set[str] | None:
    """The NUL-separated names that git prints; None where it fails."""
    command = ["git", "-C", str(root), "-c", "safe.directory=*", "-c", "core.fsmonitor=false"]
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        done = subprocess.run(
            [*command, *arguments],
            env=environment,
            capture_output=True,
            timeout=_TIME_LIMIT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    if done.returncode != 0:
        return None
    return {os.fsdecode(name) for name in done.stdout.split(b"\0") if name}
