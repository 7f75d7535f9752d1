# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Hook sets: which of our lines go where, read from ``patches/<host>/*.ini``."""

from __future__ import annotations

import configparser
import re
from dataclasses import dataclass
from pathlib import Path

PATCHES = Path(__file__).resolve().parents[2]
FLAVOURS = ("ros1", "ros2")
POSITIONS = ("after-line", "after-statement", "before-statement")

_KEYS = {"files", "anchor", "position", "fragment", "what", "why", "test"}
_OPTIONAL = {"when", "unless", "flavours"}


@dataclass(frozen=True)
class Hook:
    """One insertion.

    Attributes:
        set_name: of the set that it belongs to.
        name: unique in its host; stands in the markers around the inserted lines.
        files: paths relative to the checkout; the first that exists is meant.
        anchors: token patterns (see ``anchor_pattern``); together they match exactly once.
        position: one of POSITIONS.
        fragments: our lines by flavour.
        what: what is inserted, for the listing.
        why: what it is for.
        test: what shows that it works.
        when: token pattern that the file must match, or the hook does not apply; may be empty.
        unless: token pattern that the file must not match; may be empty.
        flavours: branches that have this hook.
    """

    set_name: str
    name: str
    files: tuple[str, ...]
    anchors: tuple[str, ...]
    position: str
    fragments: dict[str, str]
    what: str
    why: str
    test: str
    when: str
    unless: str
    flavours: tuple[str, ...]


@dataclass(frozen=True)
class HookSet:
    """The hooks of one file, in the order in which they are listed."""

    name: str
    hooks: tuple[Hook, ...]


def anchor_pattern(anchor: str) -> re.Pattern[str]:
    """Compiles an anchor: tokens separated by spaces, with any white space between them.

    ``{a|b}`` stands for either, ``<name>`` captures one word for ``@name@`` in the fragment.
    """
    tokens = anchor.split()
    parts: list[str] = []
    for i, token in enumerate(tokens):
        if i > 0:
            parts.append(r"\s+" if _is_word(tokens[i - 1][-1]) and _is_word(token[0]) else r"\s*")
        parts.append(_token_pattern(token))
    return re.compile("".join(parts))


def _is_word(character: str) -> bool:
    return character.isalnum() or character == "_"


def _token_pattern(token: str) -> str:
    if re.fullmatch(r"<[a-z_]+>", token):
        return rf"(?P{token}[^\s()]+)"
    if re.fullmatch(r"\{.+\|.+\}", token):
        return "(?:" + "|".join(map(_token_pattern, token[1:-1].split("|"))) + ")"
    before = r"(?<!\w)" if _is_word(token[0]) else ""
    after = r"(?!\w)" if _is_word(token[-1]) else ""
    return before + re.escape(token) + after


def load_set(host: str, name: str = "hooks", root: Path = PATCHES) -> HookSet | None:
    """Reads ``<root>/<host>/<name>.toml``; None where the host has no such set.

    Raises:
        ValueError: the set is not well formed.
    """
    path = root / host / f"{name}.ini"
    if not path.exists():
        return None
    parser = configparser.ConfigParser(
        delimiters=("=",), comment_prefixes=("#",), interpolation=None, default_section=""
    )
    try:
        parser.read_string(path.read_text(encoding="utf-8"), path.name)
    except configparser.Error as error:
        raise ValueError(f"{host}: {error}") from error
    return HookSet(name, tuple(_read_hook(path, n, dict(parser[n])) for n in parser.sections()))


def _read_hook(path: Path, name: str, entry: dict[str, str]) -> Hook:
    folder = path.parent
    flavours = tuple(entry.get("flavours", " ".join(FLAVOURS)).split())
    if entry.get("position") not in POSITIONS or not set(flavours) <= set(FLAVOURS):
        raise ValueError(f"{folder.name}, hook {name}: unknown position or flavour")
    by_flavour = {f: entry.pop(f"fragment.{f}", entry.get("fragment", "")) for f in flavours}
    if all(by_flavour.values()):
        entry.setdefault("fragment", "")
    if not _KEYS <= set(entry) <= _KEYS | _OPTIONAL:
        odd = sorted(set(entry) ^ _KEYS - _OPTIONAL)
        raise ValueError(f"{folder.name}, hook {name}: keys missing or unknown: {', '.join(odd)}")
    return Hook(
        set_name=path.stem,
        name=name,
        files=tuple(entry["files"].split()),
        anchors=tuple(filter(None, entry["anchor"].splitlines())),
        position=entry["position"],
        fragments={
            f: (folder / "fragments" / by_flavour[f]).read_text("latin-1") for f in flavours
        },
        what=entry["what"],
        why=entry["why"],
        test=entry["test"],
        when=entry.get("when", ""),
        unless=entry.get("unless", ""),
        flavours=flavours,
    )
