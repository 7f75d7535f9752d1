# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Works out, without touching anything, what every file shall hold."""

from __future__ import annotations

import hashlib
import os
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from d2lio_patch import blocks
from d2lio_patch.errors import E_ANCHOR, E_DIRTY, E_HOST, PatchError
from d2lio_patch.hooks import Hook, HookSet
from d2lio_patch.hosts import Host
from d2lio_patch.locate import AnchorError, Site, applies, find_site
from d2lio_patch.source import Source


def digest(data: bytes) -> str:
    """SHA-256, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


@dataclass(frozen=True)
class Insertion:
    """A hook that found its place."""

    hook: Hook
    path: str
    site: Site
    fragment: str


@dataclass(frozen=True)
class FilePlan:
    """One file.

    Attributes:
        path: relative to the checkout.
        target: the file itself, symbolic links resolved; inside the checkout.
        current: what it holds now.
        original: what it holds without our lines.
        wanted: what it shall hold.
    """

    path: str
    target: Path
    current: bytes
    original: bytes
    wanted: bytes

    @property
    def changes(self) -> bool:
        """Whether anything is to be written."""
        return self.current != self.wanted


@dataclass(frozen=True)
class Plan:
    """All files, and all insertions in the order of the hook sets."""

    files: tuple[FilePlan, ...]
    insertions: tuple[Insertion, ...]


def plan_patch(host: Host, sets: list[HookSet], checkout_of_ours: str) -> Plan:
    """Plans to have exactly these sets in the checkout.

    Args:
        host: the recognised checkout.
        sets: hook sets, in order.
        checkout_of_ours: absolute path of this project, for ``@d2lio@`` in fragments.

    Raises:
        PatchError: an anchor cannot be used; all of them are named.
    """
    hooks = [h for s in sets for h in s.hooks if host.flavour in h.flavours]
    problems: list[str] = []
    opened: dict[str, tuple[Path, bytes, Source]] = {}
    insertions: list[Insertion] = []
    for hook in hooks:
        path = next((name for name in hook.files if (host.root / name).exists()), None)
        if path is None:
            problems.append(f"anchor '{hook.name}': {hook.files[0]} is not there")
            continue
        if path not in opened:
            opened[path] = open_file(host.root, path)
        source = opened[path][2]
        if not applies(source, hook):
            continue
        try:
            insertions.append(_place(host, hook, source, checkout_of_ours))
        except AnchorError as reason:
            shown = " or ".join(hook.anchors)
            problems.append(f"anchor '{hook.name}' ({shown}) in {path}: {reason}")
    if problems:
        raise PatchError(E_ANCHOR, "\n".join([*problems, "no file was touched"]))
    return Plan(tuple(_merge(opened, insertions)), tuple(insertions))


def plan_revert(host: Host, paths: list[str]) -> Plan:
    """Plans to have none of our lines in these files."""
    files = []
    for path in paths:
        if (host.root / path).exists():
            target, current, source = open_file(host.root, path)
            original = source.text.encode("latin-1")
            files.append(FilePlan(path, target, current, original, original))
    return Plan(tuple(files), ())


def open_file(root: Path, path: str) -> tuple[Path, bytes, Source]:
    """Reads a file: where it really is, what it holds, and its source without our lines.

    Raises:
        PatchError: it lies outside the checkout, is no file, or its marker lines were edited.
    """
    target = (root / path).resolve()
    if not target.is_relative_to(root):
        raise PatchError(E_HOST, f"{path}: is a symbolic link out of the checkout, to {target}")
    if not target.is_file():
        raise PatchError(E_HOST, f"{path}: not a file")
    current = target.read_bytes()
    try:
        text = blocks.strip(current.decode("latin-1"))
    except blocks.MarkerError as reason:
        raise PatchError(E_DIRTY, f"{path}: {reason}; mend or restore the file first") from None
    return target, current, Source(path, text)


def _place(host: Host, hook: Hook, source: Source, checkout_of_ours: str) -> Insertion:
    site = find_site(source, hook)
    fragment = hook.fragments[host.flavour]
    for name, value in {**site.captures, "d2lio": _as_latin1(checkout_of_ours)}.items():
        fragment = fragment.replace(f"@{name}@", value)
    return Insertion(hook, source.path, site, fragment)


def _as_latin1(path: str) -> str:
    """The path's bytes, one character each, as Source has them."""
    return os.fsencode(path).decode("latin-1")


def _merge(
    opened: dict[str, tuple[Path, bytes, Source]], insertions: list[Insertion]
) -> list[FilePlan]:
    files = []
    for path, (target, current, source) in opened.items():
        here = [(i.site, i.hook.name, i.fragment) for i in insertions if i.path == path]
        wanted = blocks.insert(source.text, source.language, here)
        if blocks.strip(wanted) != source.text:  # cannot happen; a revert must be exact
            raise PatchError(E_ANCHOR, f"{path}: the insertion could not be taken back exactly")
        _check_xml(path, source, wanted)
        files.append(
            FilePlan(path, target, current, source.text.encode("latin-1"), wanted.encode("latin-1"))
        )
    return files


def _check_xml(path: str, source: Source, wanted: str) -> None:
    if source.language != "xml":
        return
    try:
        ET.fromstring(source.text.encode("latin-1"))
        ET.fromstring(wanted.encode("latin-1"))
    except ET.ParseError as reason:
        raise PatchError(E_ANCHOR, f"{path}: not well-formed XML: {reason}") from None
