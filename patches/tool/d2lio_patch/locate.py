# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Finds an anchor in a source file, and the offset at which whole lines can be inserted there."""

from __future__ import annotations

import re
from dataclasses import dataclass

from d2lio_patch.hooks import Hook, anchor_pattern
from d2lio_patch.source import Source

_OPENING, _CLOSING = "([{", ")]}"
_CONTROL = re.compile(r"(if|for|while|switch|catch|else|do)\b")
_LABELS = re.compile(r"\s*(?:(?!\d)\w+\s*:(?!:)\s*)*")


class AnchorError(Exception):
    """The anchor is absent, is there more than once, or stands where no line can be inserted."""


@dataclass(frozen=True)
class Site:
    """Where lines go.

    Attributes:
        offset: in the text; the start of a line, or the end of the file.
        line: number of the line that the anchor is in, from 1.
        indent: white space in front of that line.
        captures: what ``<name>`` tokens of the anchor matched.
    """

    offset: int
    line: int
    indent: str
    captures: dict[str, str]


def applies(source: Source, hook: Hook) -> bool:
    """Whether the conditions ``when`` and ``unless`` of the hook hold for the file."""
    if hook.when and not anchor_pattern(hook.when).search(source.code):
        return False
    return not (hook.unless and anchor_pattern(hook.unless).search(source.code))


def find_site(source: Source, hook: Hook) -> Site:
    """Finds where the hook's lines go.

    Raises:
        AnchorError: with the reason.
    """
    match = _only_match(source, hook)
    start = match.start()
    if hook.position == "before-statement":
        start = _statement_start(source, match.start())
        offset = _line_before(source, start)
    elif hook.position == "after-statement":
        start = _statement_start(source, match.start()) if source.language == "cpp" else start
        offset = _line_after(source, _statement_end(source, match.start()))
    else:
        if source.language == "cpp" and source.conditional_depth(match.start()) > 0:
            raise AnchorError(f"stands inside #if (line {source.line_number(start)})")
        offset = _line_after(source, match.end(), alone=False)
    line = source.line_start(start)
    indent = re.match(r"[ \t]*", source.text[line:])
    captures = {k: v for k, v in match.groupdict().items() if v is not None}
    return Site(offset, source.line_number(start), indent[0] if indent else "", captures)


def _only_match(source: Source, hook: Hook) -> re.Match[str]:
    found = [m for anchor in hook.anchors for m in _matches(source, anchor)]
    if not found:
        raise AnchorError("not found")
    if len(found) > 1:
        lines = ", ".join(str(source.line_number(m.start())) for m in found)
        raise AnchorError(f"found {len(found)} times (lines {lines})")
    return found[0]


def _matches(source: Source, anchor: str) -> list[re.Match[str]]:
    """All places of an anchor; inside a string only where the anchor itself has a quote."""
    text = source.code if '"' in anchor else source.unquoted
    return list(anchor_pattern(anchor).finditer(text))


def _statement_start(source: Source, anchor: int) -> int:
    """Start of the statement around the anchor, behind its labels.

    Raises:
        AnchorError: if, for, else and the like decide on the statement without braces.
    """
    bare = source.bare
    boundary = max(bare.rfind(c, 0, anchor) for c in ";{}") + 1
    labels = _LABELS.match(bare, boundary, anchor)
    start = labels.end() if labels else boundary
    if _CONTROL.match(bare, start, anchor) and not _in_condition(bare, start, anchor):
        line = source.line_number(anchor)
        raise AnchorError(f"belongs to an if, for or else without braces (line {line})")
    return start


def _in_condition(bare: str, start: int, anchor: int) -> bool:
    """Whether a parenthesis that was opened since ``start`` is still open at the anchor."""
    return bare.count("(", start, anchor) > bare.count(")", start, anchor)


def _statement_end(source: Source, anchor: int) -> int:
    """Offset behind the ``;`` (C++) or ``)`` (CMake) that ends the statement of the anchor."""
    bare, depth = source.bare, 0
    is_cmake = source.language == "cmake"
    if not is_cmake:
        start = _statement_start(source, anchor)
        if _CONTROL.match(bare, start):
            line = source.line_number(anchor)
            raise AnchorError(f"is part of an if, for or while (line {line})")
        anchor = start
    for i in range(anchor, len(bare)):
        depth += (bare[i] in _OPENING) - (bare[i] in _CLOSING)
        if depth <= 0 and bare[i] == (")" if is_cmake else ";"):
            return i + 1
    raise AnchorError(f"statement has no end (line {source.line_number(anchor)})")


def _line_after(source: Source, end: int, alone: bool = True) -> int:
    """Offset of the next line that starts outside every comment.

    Raises:
        AnchorError: more code follows on the line, or the line goes on with a backslash.
    """
    while True:
        line_end = source.line_end(end)
        rest = source.code[end:line_end]
        if (alone and rest.strip()) or source.text[end:line_end].rstrip().endswith("\\"):
            line = source.line_number(end)
            raise AnchorError(f"is followed by more code on its line (line {line})")
        comment = source.comment_at(line_end - 1)
        if comment is None or comment[1] == len(source.text):
            return line_end
        end, alone = comment[1], True


def _line_before(source: Source, start: int) -> int:
    """Offset of the start of the statement's line, outside every comment.

    Raises:
        AnchorError: code stands in front of the statement on its line.
    """
    while True:
        line = source.line_start(start)
        if source.code[line:start].strip():
            raise AnchorError(f"has code in front of it (line {source.line_number(start)})")
        comment = source.comment_at(line)
        if comment is None or comment[0] == line:
            break
        start = comment[0]
    above = source.code[:line].rstrip().rpartition("\n")[2]
    if re.match(r"[ \t]*#[ \t]*pragma\b", above):
        raise AnchorError(f"stands under a #pragma (line {source.line_number(start)})")
    return line
