# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Pages in one file that need nothing else: templates, embedded data, plotly."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np

_MISSING = 65535  # of a packed curve: no number
_MARK = re.compile(r"@@([A-Z_]+)@@")


def asset(name: str) -> str:
    """A file of this package as text."""
    return files("d2lio.report").joinpath(name).read_text(encoding="utf-8")


def script_json(value: Any) -> str:
    """JSON that can stand inside a script element."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("</", "<\\/").replace("<!--", "<\\!--")


def plotly_source() -> str:
    """plotly.js as it can stand inside a script element."""
    from plotly.offline import get_plotlyjs

    return get_plotlyjs().replace("</script", "<\\/script")


def fill(template: str, values: Mapping[str, str]) -> str:
    """Replaces every @@NAME@@ in one pass: what a value contains is left as it is.

    Style, chart code and plotly are there for every template.
    """
    known = dict(values)
    shared = {
        "STYLE": lambda: asset("style.css"),
        "CHARTS": lambda: asset("charts.js"),
        "PLOTLY": plotly_source,
    }

    def value(match: re.Match[str]) -> str:
        name = match.group(1)
        return known[name] if name in known else shared[name]()

    return _MARK.sub(value, template)


def pack(values: np.ndarray, log: bool = False) -> dict[str, Any] | None:
    """A curve in 16 bits per value: a quarter of its decimals' size, finer than a screen shows.

    Args:
        values: [N]; what is not finite becomes a gap, and with `log` what is not positive.
        log: keeps the ratio of neighbours, not their difference.

    Returns:
        `d` base64 of little-endian uint16 q, value = o + s q (its power of ten with `l`); None
        where there is no number at all.
    """
    array = np.asarray(values, np.float64)
    if log:
        array = np.log10(np.where(array > 0.0, array, np.nan))
    good = np.isfinite(array)
    if not good.any():
        return None
    low, high = float(array[good].min()), float(array[good].max())
    scale = (high - low) / (_MISSING - 1)
    codes = np.full(len(array), _MISSING, "<u2")
    codes[good] = np.round((array[good] - low) / scale) if scale > 0.0 else 0
    packed = {"o": _short(low), "s": _short(scale), "d": base64.b64encode(codes.tobytes()).decode()}
    return packed | {"l": 1} if log else packed


def unpack(packed: Mapping[str, Any]) -> np.ndarray:
    """The values of `pack`, float64 [N]; gaps are NaN."""
    codes = np.frombuffer(base64.b64decode(packed["d"]), "<u2")
    values = packed["o"] + packed["s"] * codes
    values = np.where(codes == _MISSING, np.nan, values)
    return 10.0**values if packed.get("l") else values


def _short(value: float) -> float:
    """Nine significant digits: far below the step of a packed curve."""
    return float(f"{value:.9g}") if math.isfinite(value) else 0.0


def stride(length: int, most: int) -> int:
    """Step that leaves at most `most` of `length` values."""
    return max(1, -(-length // max(1, most)))
