# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Our lines in a text: put in between two marker lines, and taken out again, byte for byte."""

from __future__ import annotations

import re
from collections.abc import Iterable

from d2lio_patch.locate import Site

_COMMENT = {"cpp": ("// ", ""), "cmake": ("# ", ""), "xml": ("<!-- ", " -->")}
_MARKER = re.compile(
    r"^[ \t]*(?://|#|<!--) d2lio:(begin|end) ([\w.-]+)(?: -->)?[ \t]*\r?$", re.MULTILINE
)


class MarkerError(Exception):
    """Marker lines do not pair up: somebody edited them."""


def newline_at(text: str, offset: int) -> str:
    """Newline of the line in front of the offset, else the file's first."""
    for end in (offset, text.find("\n") + 1):
        if text[:end].endswith("\n"):
            return "\r\n" if text[:end].endswith("\r\n") else "\n"
    return "\n"


def insert(text: str, language: str, additions: Iterable[tuple[Site, str, str]]) -> str:
    """Inserts (site, hook name, fragment); those of one offset keep their order."""
    parts, at = [], 0
    for site, name, fragment in sorted(additions, key=lambda a: a[0].offset):
        parts.append(text[at : site.offset])
        parts.append(_block(text, language, site, name, fragment))
        at = site.offset
    return "".join([*parts, text[at:]])


def _block(text: str, language: str, site: Site, name: str, fragment: str) -> str:
    opening, closing = _COMMENT[language]
    lines = [
        f"{opening}d2lio:begin {name}{closing}",
        *fragment.splitlines(),
        f"{opening}d2lio:end {name}{closing}",
    ]
    newline = newline_at(text, site.offset)
    block = newline.join(site.indent + line if line else "" for line in lines)
    if site.offset == len(text) and text and not text.endswith("\n"):
        return newline + block  # the file's last line has no newline, and shall have none again
    return block + newline


def names(text: str) -> list[str]:
    """Names of the hooks whose lines are in the text."""
    return [m[2] for m in _MARKER.finditer(text) if m[1] == "begin"]


def strip(text: str) -> str:
    """The text without our lines: the inverse of insert.

    Raises:
        MarkerError: a marker stands alone.
    """
    parts, at = [], 0
    markers = list(_MARKER.finditer(text))
    for begin, end in zip(markers[::2], markers[1::2]):
        if (begin[1], end[1]) != ("begin", "end") or begin[2] != end[2]:
            raise MarkerError(f"the lines around 'd2lio:{begin[1]} {begin[2]}' were edited")
        first, last = begin.start(), end.end()
        if last < len(text):
            last += 1
        elif first > 0:  # a block at the end of a file without a final newline
            first -= len(newline_at(text, first))
        parts.append(text[at:first])
        at = last
    if len(markers) % 2:
        raise MarkerError(f"the lines around 'd2lio:{markers[-1][1]} {markers[-1][2]}' were edited")
    return "".join([*parts, text[at:]])
