# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""All files or none: the tool is killed, or the system fails it, at every single step."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from patch_standins import edit, make, patch, snapshot, source_name

E_DISK, E_PENDING, E_IO, E_INTERRUPTED = 13, 23, 24, 130
MOST_STEPS = 400
SOURCE = source_name("fast_lio")
# Every call by which the tool changes anything.
STEPS = ["mkdir", "open", "write", "fsync", "link", "replace", "unlink", "rmdir", "chown", "chmod"]


@pytest.fixture(autouse=True)
def _no_waiting_for_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)  # no git


class Trap:
    """Counts the steps, and springs at one of them."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, at: int, spring: Callable[[], None]
    ) -> None:
        self.count, self.at, self.spring = 0, at, spring
        for name in STEPS:
            monkeypatch.setattr(os, name, self._wrap(name, getattr(os, name)))

    def _wrap(self, name: str, real: Callable) -> Callable:
        def step(*arguments, **options):
            self.count += 1
            if self.count == self.at:
                if name == "write":  # half of it arrives
                    real(arguments[0], bytes(arguments[1])[: len(arguments[1]) // 2])
                self.spring()
            return real(*arguments, **options)

        return step


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def killed_at(step: int, root: Path, *options: str) -> bool:
    """Runs the tool in a child that is killed at a step; False where it ended before."""
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        Trap(pytest.MonkeyPatch(), step, die)
        os._exit(patch(root, *options))
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return True
    assert os.waitstatus_to_exitcode(status) == 0
    return False


def records(root: Path) -> list[str]:
    folder = root / ".d2lio-patch"
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


@pytest.mark.parametrize("then", ["patch", "revert"])
@pytest.mark.parametrize("first", ["patch", "revert"])
def test_next_call_clears_up_wherever_the_first_was_killed(
    tmp_path: Path, first: str, then: str
) -> None:
    options = {"patch": [], "revert": ["--revert"]}
    reference = make(tmp_path / "reference")
    original = snapshot(reference)
    assert patch(reference) == 0
    patched = snapshot(reference)
    for step in range(1, MOST_STEPS):
        root = make(tmp_path / str(step))
        if first == "revert":
            assert patch(root) == 0
        was_killed = killed_at(step, root, *options[first])
        assert patch(root, *options[then]) == 0
        assert snapshot(root) == (patched if then == "patch" else original), f"step {step}"
        assert records(root) == ([".gitignore", "state.json"] if then == "patch" else [])
        if not was_killed:
            break
    assert 30 < step < MOST_STEPS - 1


def test_killed_while_clearing_up(tmp_path: Path) -> None:
    reference = make(tmp_path / "reference")
    assert patch(reference) == 0
    for step in (25, 40, 50, 55, 60):
        for second in range(1, MOST_STEPS):
            root = make(tmp_path / f"{step} {second}")
            assert killed_at(step, root)
            was_killed = killed_at(second, root)
            assert patch(root) == 0
            assert snapshot(root) == snapshot(reference)
            assert records(root) == [".gitignore", "state.json"]
            if not was_killed:
                break
            if second > 12:  # the rest of the call is a first call's
                break


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), E_DISK),
        (OSError(errno.EIO, "Input/output error"), E_IO),
        (KeyboardInterrupt(), E_INTERRUPTED),
    ],
    ids=["disk full", "broken disk", "interrupted"],
)
def test_failure_leaves_all_or_nothing(
    tmp_path: Path, failure: BaseException, code: int, capsys
) -> None:
    def fail() -> None:
        raise failure

    reference = make(tmp_path / "reference")
    assert patch(reference) == 0
    undone = 0
    for step in range(1, MOST_STEPS):
        root = make(tmp_path / str(step))
        before = snapshot(root)
        with pytest.MonkeyPatch.context() as monkeypatch:
            trap = Trap(monkeypatch, step, fail)
            result = patch(root)
        if trap.count < step:
            break
        assert result in (code, E_IO, 0)
        assert snapshot(root) in (before, snapshot(reference)), f"step {step}"
        undone += snapshot(root) == before and result == code
        assert patch(root) == 0
        assert snapshot(root) == snapshot(reference)
        assert records(root) == [".gitignore", "state.json"]
        assert patch(root, "--revert") == 0
        assert snapshot(root) == before
    assert 20 < undone < step < MOST_STEPS - 1


def test_full_disk_leaves_no_litter(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    before = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(os, "write", full)
        assert patch(root) == E_DISK
    assert "disk is full" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in root.rglob("*") if path.is_file()} == before
    assert not (root / ".d2lio-patch").exists()


def half_patched(tmp_path: Path) -> Path:
    """A checkout in which a call was killed between two of its final renames."""
    for step in range(1, MOST_STEPS):
        root = make(tmp_path / str(step))
        assert killed_at(step, root)
        inside = ["d2lio:begin" in (root / n).read_text() for n in (SOURCE, "package.xml")]
        if inside == [True, False]:
            return root
    raise AssertionError("no such step")


def test_looking_at_a_half_patched_checkout_touches_nothing(tmp_path: Path, capsys) -> None:
    root = half_patched(tmp_path)
    before = snapshot(root)
    assert patch(root, "--check") == 0
    assert "was interrupted" in capsys.readouterr().err
    assert snapshot(root) == before
    assert "commit.json" in records(root)


def test_file_that_was_edited_in_a_half_patched_checkout(tmp_path: Path, capsys) -> None:
    root = half_patched(tmp_path)
    edit(root / "package.xml", "<export>", "<export> ")
    before = snapshot(root)
    assert patch(root) == E_PENDING
    assert "package.xml" in capsys.readouterr().err
    assert snapshot(root) == before
    assert patch(root, "--force") == 0
    assert "<export> " in (root / "package.xml").read_text()
    assert "d2lio:begin" in (root / "package.xml").read_text()
    assert records(root) == [".gitignore", "state.json"]


def test_file_that_changes_while_it_is_patched(tmp_path: Path, monkeypatch) -> None:
    root = make(tmp_path / "x")
    real = os.link

    def link(path: Path, to: Path) -> None:
        real(path, to)
        if Path(path).name == "package.xml":
            Path(path).unlink()
            Path(path).write_text("somebody else's\n")

    monkeypatch.setattr(os, "link", link)
    source = (root / SOURCE).read_bytes()
    assert patch(root) == E_PENDING
    assert (root / "package.xml").read_text() == "somebody else's\n"
    assert (root / SOURCE).read_bytes() == source
    assert records(root) == []


@pytest.mark.parametrize("path", ["../outside", "/etc/outside"])
def test_journal_that_names_files_elsewhere_is_not_followed(tmp_path: Path, path: str) -> None:
    root = half_patched(tmp_path)
    journal = root / ".d2lio-patch/commit.json"
    record = json.loads(journal.read_text())
    record["entries"][0]["temp"] = path
    journal.write_text(json.dumps(record))
    before = snapshot(root)
    assert patch(root, "--force") == E_PENDING
    assert snapshot(root) == before


def test_file_system_without_hard_links(tmp_path: Path, monkeypatch) -> None:
    def no_links(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")

    root = make(tmp_path / "x")
    before = snapshot(root)
    monkeypatch.setattr(os, "link", no_links)
    assert patch(root) == 0
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before
