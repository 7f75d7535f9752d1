# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""YAML files that become models: reading them, and wording the first thing that is wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import yaml
from pydantic import ValidationError

from d2lio.errors import ConfigError, DataError

Location = tuple[int | str, ...]
LONGEST = 80  # characters of a value in a message


def read_yaml(file: Path) -> object:
    """What a YAML file holds.

    Raises:
        DataError: missing, unreadable or no YAML.
    """
    try:
        return yaml.safe_load(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{file}: no such file") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise DataError(f"{file}: cannot be read: {reason}") from None


def first_complaint(
    error: ValidationError,
    where: str,
    whole: str,
    known_keys: Callable[[Location], str],
    plain: Callable[[object], object],
) -> ConfigError:
    """The first complaint of pydantic as ours.

    Args:
        where: file, for the message.
        whole: name of the key where the complaint is about all of it.
        known_keys: of the section that holds the key at a location, as text.
        plain: a value as it may stand in a message.
    """
    # A misspelt key shows up twice, as missing and as unknown: name the unknown one first.
    details = sorted(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    first = details[0]
    key = ".".join(str(part) for part in first["loc"]) or whole
    if first["type"] == "missing":
        return ConfigError(key, None, "this key is missing and must be given", where)
    allowed = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        allowed = f"no such key; known keys: {known_keys(first['loc'])}"
    return ConfigError(key, shortened(plain(first["input"])), allowed, where)


def shortened(value: object) -> object:
    """The value, or the beginning of its text."""
    text = repr(value)
    return value if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
