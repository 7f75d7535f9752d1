# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Changes several files together or not at all, through kills, full disks and power cuts.

All new contents are written beside their targets first; one rename of the journal decides; then
come only renames. Whatever a killed call left, the next one (``recover``) completes or undoes.

``.d2lio-patch/`` holds: ``state.json`` (what was patched), and during a call ``journal.json``
(undecided), ``commit.json`` (decided), ``backup-N`` (links to the files as they were).
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from dataclasses import asdict, dataclass
from pathlib import Path

from d2lio_patch.errors import E_IO, E_PENDING, PatchError
from d2lio_patch.plan import FilePlan, digest

FOLDER = ".d2lio-patch"
STATE, JOURNAL, COMMIT, NEXT = "state.json", "journal.json", "commit.json", "state.next"
_IGNORE_ALL = b"*\n"  # git shall not list the folder


@dataclass(frozen=True)
class Entry:
    """One file of a transaction; paths are relative to the checkout, hashes SHA-256."""

    target: str
    temp: str
    backup: str
    old: str
    new: str


class Transaction:
    """Replaces files of a checkout, and the state record with them.

    Args:
        root: the checkout.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.folder = root / FOLDER

    # --- a new change

    def run(self, files: list[FilePlan], state: dict | None) -> None:
        """Writes all files and the state (None: removes it), or nothing.

        Raises:
            OSError: nothing was changed.
            PatchError: nothing was changed, as somebody else changed a file meanwhile; or all was,
                and the next call has to clear up.
        """
        entries: list[Entry] = []
        try:
            self._make_folder()
            entries = self._journal(files, state is None)
            self._prepare(files, entries, state)
            self._decide(entries)
            self._replace(entries)
        except BaseException:
            self._undo(entries)
            raise
        try:
            self._finish(entries, state is None)
        except OSError as error:
            message = f"all files are written, but clearing up failed: {error}; call again"
            raise PatchError(E_IO, message) from error

    def _make_folder(self) -> None:
        with contextlib.suppress(FileExistsError):
            os.mkdir(self.folder)
        if not (self.folder / ".gitignore").exists():
            _write(self.folder / ".gitignore", _IGNORE_ALL)

    def _journal(self, files: list[FilePlan], removes_state: bool) -> list[Entry]:
        mark = secrets.token_hex(4)
        entries = []
        for number, file in enumerate(files):
            temp = file.target.with_name(f".{file.target.name}.d2lio-{mark}")
            entries.append(
                Entry(
                    str(file.target.relative_to(self.root)),
                    str(temp.relative_to(self.root)),
                    f"{FOLDER}/backup-{number}",
                    digest(file.current),
                    digest(file.wanted),
                )
            )
        record = {"removes_state": removes_state, "entries": [asdict(e) for e in entries]}
        _write(self.folder / "journal.tmp", json.dumps(record, indent=1).encode())
        os.replace(self.folder / "journal.tmp", self.folder / JOURNAL)
        _sync_folder(self.folder)
        return entries

    def _prepare(self, files: list[FilePlan], entries: list[Entry], state: dict | None) -> None:
        for file, entry in zip(files, entries):
            _write(self.root / entry.temp, file.wanted, like=file.target)
            _link(file.target, self.root / entry.backup)
        if state is not None:
            _write(self.folder / NEXT, json.dumps(state, indent=1).encode())
        for folder in {(self.root / entry.temp).parent for entry in entries} | {self.folder}:
            _sync_folder(folder)

    def _decide(self, entries: list[Entry]) -> None:
        for entry in entries:
            if self._hash(entry.target) != entry.old:
                raise PatchError(E_PENDING, f"{entry.target}: changed while it was being patched")
        os.replace(self.folder / JOURNAL, self.folder / COMMIT)
        _sync_folder(self.folder)

    def _replace(self, entries: list[Entry]) -> None:
        for entry in entries:
            if (self.root / entry.temp).exists():
                os.replace(self.root / entry.temp, self.root / entry.target)
        for folder in {(self.root / entry.target).parent for entry in entries}:
            _sync_folder(folder)

    def _finish(self, entries: list[Entry], removes_state: bool) -> None:
        if removes_state:
            (self.folder / STATE).unlink(missing_ok=True)
        elif (self.folder / NEXT).exists():
            os.replace(self.folder / NEXT, self.folder / STATE)
        _sync_folder(self.folder)
        self._clean(entries)

    def _undo(self, entries: list[Entry]) -> None:
        for entry in entries:
            backup = self.root / entry.backup
            if backup.exists() and self._hash(entry.target) == entry.new != entry.old:
                os.replace(backup, self.root / entry.target)
        self._clean(entries)

    def _clean(self, entries: list[Entry]) -> None:
        """Removes all but the state; the journal last, as it names the rest."""
        for entry in entries:
            (self.root / entry.temp).unlink(missing_ok=True)
        if not self.folder.exists():
            return
        for path in self.folder.glob("backup-*"):
            path.unlink()
        for name in (NEXT, "journal.tmp", JOURNAL, COMMIT):
            (self.folder / name).unlink(missing_ok=True)
        if not (self.folder / STATE).exists():
            (self.folder / ".gitignore").unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # something of the user's is in it
                os.rmdir(self.folder)

    # --- what an earlier call left

    def pending(self) -> bool:
        """Whether an earlier call was cut off."""
        return any((self.folder / name).exists() for name in (JOURNAL, COMMIT))

    def recover(self, force: bool = False) -> str:
        """Completes or undoes what an earlier call left; says what was done, or nothing.

        Args:
            force: leave files as they are that changed since, and forget the earlier call.

        Raises:
            PatchError: a file is neither as it was nor as it should have become.
        """
        if self.folder.is_symlink():
            raise PatchError(E_PENDING, f"{FOLDER} is a symbolic link; remove it")
        if not self.pending():
            if self.folder.exists():
                self._clean([])
            return ""
        decided = (self.folder / COMMIT).exists()
        removes_state, entries = self._read(COMMIT if decided else JOURNAL)
        if not decided:
            self._clean(entries)
            return "an interrupted call was undone"
        if all(self._is_new(e) or self._can_go(e, e.old, e.temp, e.new) for e in entries):
            self._replace(entries)
            self._finish(entries, removes_state)
            return "an interrupted call was completed"
        if all(self._is_old(e) or self._can_go(e, e.new, e.backup, e.old) for e in entries):
            self._undo(entries)
            return "an interrupted call was undone"
        if not force:
            odd = [e.target for e in entries if not self._is_new(e) and not self._is_old(e)]
            raise PatchError(
                E_PENDING,
                "an earlier call was interrupted, and since then somebody changed "
                f"{', '.join(odd) or 'its temporary files'}; --force goes on with the files as "
                "they are",
            )
        self._clean(entries)
        return "an interrupted call was forgotten"

    def _read(self, name: str) -> tuple[bool, list[Entry]]:
        try:
            record = json.loads((self.folder / name).read_bytes())
            entries = [Entry(**entry) for entry in record["entries"]]
            paths = [self.root / p for e in entries for p in (e.target, e.temp, e.backup)]
            if not all(path.parent.resolve().is_relative_to(self.root) for path in paths):
                raise ValueError("a path out of the checkout")
            return record["removes_state"], entries
        except (ValueError, KeyError, TypeError):
            path = f"{FOLDER}/{name}"
            raise PatchError(
                E_PENDING, f"{path}: not readable; remove {FOLDER}/ yourself"
            ) from None

    def _is_new(self, entry: Entry) -> bool:
        return self._hash(entry.target) == entry.new

    def _is_old(self, entry: Entry) -> bool:
        return self._hash(entry.target) == entry.old

    def _can_go(self, entry: Entry, now: str, source: str, to: str) -> bool:
        return self._hash(entry.target) == now and self._hash(source) == to

    def _hash(self, path: str) -> str:
        try:
            return digest((self.root / path).read_bytes())
        except OSError:
            return ""

    # --- the record

    def state(self) -> dict | None:
        """What was patched: sets and the hashes of the files; None where nothing is known."""
        try:
            return json.loads((self.folder / STATE).read_bytes())
        except (OSError, ValueError):
            return None


def _write(path: Path, data: bytes, like: Path | None = None) -> None:
    """Writes a new file to the disk itself, with the permissions and owner of another."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644 if like is None else 0o600)
    try:
        view = memoryview(data)
        while view:
            view = view[os.write(handle, view) :]
        if like is not None:
            owner = like.stat()
            with contextlib.suppress(OSError):
                os.chown(path, owner.st_uid, owner.st_gid)
            os.chmod(path, owner.st_mode & 0o7777)  # after chown, which clears the set-id bits
        os.fsync(handle)
    finally:
        os.close(handle)


def _link(path: Path, to: Path) -> None:
    try:
        os.link(path, to)
    except FileExistsError:
        to.unlink()
        os.link(path, to)
    except OSError:  # a file system without hard links
        _write(to, path.read_bytes(), like=path)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
