# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Refuses to touch what the user has at work: edited and read-only files, a call under way."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from d2lio_patch.errors import E_DIRTY, E_PENDING, PatchError
from d2lio_patch.plan import FilePlan, digest
from d2lio_patch.repository import compare_with_commit


def refuse_dirty(root: Path, files: list[FilePlan], state: dict | None) -> None:
    """Checks the files that are to be written.

    Raises:
        PatchError: some are read-only, or changed since the last commit or our last call.
    """
    record = state["files"] if state else {}
    paths = [str(file.target.relative_to(root)) for file in files]
    differs = compare_with_commit(root, paths)
    problems = []
    for file, path in zip(files, paths):
        reason = _edited(file, record.get(file.path), differs.get(path))
        if reason:
            problems.append(f"{file.path}: {reason}")
        if not file.target.stat().st_mode & stat.S_IWUSR:
            problems.append(f"{file.path}: is read-only")
    if problems:
        advice = "commit your changes first, or go on with --force (which keeps them)"
        raise PatchError(E_DIRTY, "\n".join([*problems, advice, "no file was touched"]))


def _edited(file: FilePlan, record: dict | None, differs: bool | None) -> str:
    if record and digest(file.current) in (record["original"], record["patched"]):
        return ""
    if differs:
        return "has changes that are not committed"
    if record and differs is None:
        return "was edited since it was patched"
    return ""


@contextlib.contextmanager
def only_one(root: Path) -> Iterator[None]:
    """Keeps a second call out of the same checkout; leaves no file behind.

    Raises:
        PatchError: another call is at work.
    """
    handle = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise PatchError(E_PENDING, "another call is at work in this checkout") from None
    except OSError:
        pass  # a file system without locks
    try:
        yield
    finally:
        os.close(handle)
