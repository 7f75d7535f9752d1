# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Columns of diagnostics.csv as arrays."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from d2lio.errors import DataError

# What becomes of a correspondence that is offered: column, and name for people.
OUTCOMES = {
    "accepted": "accepted",
    "rejected_few_neighbours": "few neighbours",
    "rejected_far_neighbours": "far neighbours",
    "rejected_threshold": "threshold",
    "rejected_singular_plane": "singular plane",
    "rejected_plane_fit": "plane fit",
    "rejected_residual": "residual",
}

# Distances of points from the body: ending of the columns offered_..., accepted_..., and name.
RANGES = {
    "to_5m": "0 to 5 m",
    "to_10m": "5 to 10 m",
    "to_20m": "10 to 20 m",
    "to_40m": "20 to 40 m",
    "to_80m": "40 to 80 m",
    "beyond_80m": "over 80 m",
}


def rejected_by_range(columns: dict[str, np.ndarray]) -> list[float | None]:
    """Share of the correspondences offered that was rejected, [0, 1], for each of RANGES.

    None where nothing was offered; empty for diagnostics without those columns.
    """
    shares: list[float | None] = []
    for ending in RANGES:
        if f"offered_{ending}" not in columns:
            return []
        offered = float(np.nansum(columns[f"offered_{ending}"]))
        accepted = float(np.nansum(columns[f"accepted_{ending}"]))
        shares.append(1.0 - accepted / offered if offered > 0.0 else None)
    return shares if any(share is not None for share in shares) else []


def read_diagnostics(file: Path) -> dict[str, np.ndarray]:
    """Numeric columns as float64 [N] (empty cells NaN), the others as text [N].

    Raises:
        DataError: unreadable file or ragged rows.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise DataError(f"{file}: cannot be read: {err}") from None
    if not rows:
        return {}
    header, body = rows[0], rows[1:]
    if any(len(row) != len(header) for row in body):
        raise DataError(f"{file}: rows of different length")
    columns = zip(*body, strict=True) if body else ((),) * len(header)
    return {name: _column(list(column)) for name, column in zip(header, columns, strict=True)}


def _column(cells: list[str]) -> np.ndarray:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells], np.float64)
    except ValueError:
        return np.array(cells, dtype=str)


def seconds_from_start(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Time of each row since the first, s [N]."""
    stamps = columns.get("stamp_ns", np.empty(0))
    return (stamps - stamps[0]) * 1e-9 if len(stamps) else stamps


def processed(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Without the scans that a host skips on purpose, as LIO-SAM does with every other one."""
    if "status" not in columns:
        return columns
    kept = columns["status"] != "skipped"
    return {name: values[kept] for name, values in columns.items()}
