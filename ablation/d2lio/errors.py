# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Errors the Python side raises on bad input."""

from __future__ import annotations


class ConfigError(ValueError):
    """A configuration value was refused.

    Attributes:
        key: dotted name of the value, e.g. ``lidar.rate_hz``.
        value: what was given.
        allowed: what would have been accepted, in words.
        where: file the value came from; empty if it came from a call.
    """

    def __init__(self, key: str, value: object, allowed: str, where: str = "") -> None:
        self.key = key
        self.value = value
        self.allowed = allowed
        self.where = where
        prefix = f"{where}: " if where else ""
        super().__init__(f"{prefix}{key} = {value!r} refused; allowed: {allowed}")


class DataError(RuntimeError):
    """Input or output data could not be read or written; the message says which and why."""
