# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""One look per variant, the same in every figure."""

from __future__ import annotations

from dataclasses import dataclass

# Okabe and Ito, "Color Universal Design" (2008), without black and yellow: each of these can be
# told apart with any colour vision, and can be seen on white and on black.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
TRUTH = "#9a9a9a"
STAGE_COLOURS = ("#264653", "#2f7ebc", "#7fb7d6", "#e58606", "#d1495b", "#2a9d4a", "#9b5de5")
OUTCOME_COLOURS = ("#2a9d4a", "#264653", "#5b8ea6", "#d1495b", "#9b5de5", "#e58606", "#e9c46a")
_MATPLOTLIB_DASHES = ("-", "--", ":", "-.", (0, (8, 3)), (0, (8, 3, 2, 3)))
_HATCHES = ("", "////", "....", "xxxx", "----", "++++")


@dataclass(frozen=True, slots=True)
class Style:
    """Colour `#rrggbb`; dash as plotly names it and as matplotlib does; hatch of a bar."""

    colour: str
    dash: str
    linestyle: str | tuple[int, tuple[int, ...]]
    hatch: str


def style(index: int) -> Style:
    """Of the variant with this index in its suite; six colours, then the same ones dashed."""
    dash = index // len(COLOURS) % len(DASHES)
    return Style(
        COLOURS[index % len(COLOURS)], DASHES[dash], _MATPLOTLIB_DASHES[dash], _HATCHES[dash]
    )
