# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A source file as the anchors see it: comments, strings and dead code blanked, offsets kept."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePath

_CPP = re.compile(
    r"(?P<comment>//(?:\\\r?\n|[^\n])*|/\*.*?(?:\*/|\Z))"
    r'|(?P<string>R"(?P<tag>[^()\\\s]{0,16})\(.*?\)(?P=tag)"'
    r"|\"(?:\\.|[^\"\\\n])*\"?|(?<![0-9A-Za-z_])'(?:\\.|[^'\\\n])+')",
    re.DOTALL,
)
_CMAKE = re.compile(
    r"(?P<comment>#\[(?P<a>=*)\[.*?\](?P=a)\]|#[^\n]*)"
    r"|(?P<string>\[(?P<b>=*)\[.*?\](?P=b)\]|\"(?:\\.|[^\"\\])*\")"
    r"|\\.",  # an escaped quote opens no string
    re.DOTALL,
)
_XML = re.compile(r"(?P<comment><!--.*?-->)|(?P<string><!\[CDATA\[.*?\]\]>)", re.DOTALL)

_DIRECTIVE = re.compile(r"^[ \t]*#[ \t]*(\w*)((?:\\\r?\n|[^\n])*)", re.MULTILINE)


def language_of(path: str) -> str:
    """Returns cpp, cmake or xml."""
    name = PurePath(path).name
    if name == "CMakeLists.txt" or name.endswith(".cmake"):
        return "cmake"
    return "xml" if name.endswith(".xml") else "cpp"


def _blank(text: str) -> str:
    return re.sub(r"[^\r\n]", " ", text)


@dataclass(frozen=True)
class Source:
    """The text of one file, one character per byte, so that it can be written back unchanged.

    Attributes:
        path: relative to the checkout, for messages and to tell the language.
        text: bytes decoded as latin-1.
    """

    path: str
    text: str

    @classmethod
    def from_bytes(cls, path: str, data: bytes) -> Source:
        """Wraps what a file holds."""
        return cls(path, data.decode("latin-1"))

    @property
    def language(self) -> str:
        """One of cpp, cmake and xml."""
        return language_of(self.path)

    @cached_property
    def _tokens(self) -> list[re.Match[str]]:
        pattern = {"cpp": _CPP, "cmake": _CMAKE, "xml": _XML}[self.language]
        return list(pattern.finditer(self.text))

    @cached_property
    def comments(self) -> list[tuple[int, int]]:
        """Spans [begin, end) of the comments."""
        return [t.span() for t in self._tokens if t["comment"] is not None]

    @cached_property
    def code(self) -> str:
        """The text with comments and ``#if 0`` blanked; strings stay."""
        return self._without_dead_code(self._masked(("comment",)))

    @cached_property
    def unquoted(self) -> str:
        """Like code, with strings blanked as well."""
        return self._without_dead_code(self._masked(("comment", "string")))

    @cached_property
    def bare(self) -> str:
        """Like unquoted, with each preprocessor line turned into one ``;``."""
        if self.language != "cpp":
            return self.unquoted
        return _DIRECTIVE.sub(lambda m: ";" + _blank(m[0][1:]), self.unquoted)

    def _masked(self, kinds: tuple[str, ...]) -> str:
        parts, at = [], 0
        for token in self._tokens:
            if any(token[kind] is not None for kind in kinds):
                parts += [self.text[at : token.start()], _blank(token[0])]
                at = token.end()
        return "".join([*parts, self.text[at:]])

    def _without_dead_code(self, text: str) -> str:
        if self.language != "cpp":
            return text
        parts, at, depth, dead_from = [], 0, 0, None
        for line in _DIRECTIVE.finditer(text):
            word = line[1]
            if dead_from is None:
                if word == "if" and line[2].strip() in ("0", "false"):
                    dead_from, depth = line.end(), 1
                continue
            if word.startswith("if"):
                depth += 1
            elif word == "endif" or (depth == 1 and word in ("else", "elif")):
                depth -= 1
            if depth == 0:
                parts += [text[at:dead_from], _blank(text[dead_from : line.start()])]
                at, dead_from = line.start(), None
        return "".join([*parts, text[at:]])

    def conditional_depth(self, offset: int) -> int:
        """How many ``#if`` enclose an offset."""
        depth = 0
        for line in _DIRECTIVE.finditer(self.code, 0, offset):
            depth += line[1].startswith("if") - (line[1] == "endif")
        return depth

    def comment_at(self, offset: int) -> tuple[int, int] | None:
        """The span of the comment that covers this character, if any."""
        return next((s for s in self.comments if s[0] <= offset < s[1]), None)

    def line_number(self, offset: int) -> int:
        """Of the line that holds this offset, from 1."""
        return self.text.count("\n", 0, offset) + 1

    def line_start(self, offset: int) -> int:
        """Offset of the first character of the line."""
        return self.text.rfind("\n", 0, offset) + 1

    def line_end(self, offset: int) -> int:
        """Offset behind the line's newline, or of the end of the file."""
        newline = self.text.find("\n", offset)
        return len(self.text) if newline < 0 else newline + 1
