# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A column of panels over one time axis: what runs believed along the direction nobody sees."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from d2lio.datasets.events import Float64
from d2lio.report import palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from d2lio.what_breaks import Along

SIZE_INCHES = (9.0, 11.5)
DPI = 100
COLOURS = 255  # of the file; with a quarter of them a line that is hardly seen loses its own
LEAST_LAMBDA = 0.01  # what is cleaned away altogether is drawn here
WINDOW_S = 1.0  # of the corrections' root mean square
OUTSTANDING = ("none", "noise_aware")  # titles of the curves that the others are compared with
_RC = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
}


def rolling_rms(seconds: Float64, values: Float64, window: float = WINDOW_S) -> Float64:
    """Root mean square over a window of s around every moment; NaN where nothing is in it."""
    half = 0.5 * window
    known = np.isfinite(values)
    squares = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0) ** 2)])
    counts = np.concatenate([[0], np.cumsum(known)])
    low = np.searchsorted(seconds, seconds - half)
    high = np.searchsorted(seconds, seconds + half, side="right")
    number = counts[high] - counts[low]
    mean = (squares[high] - squares[low]) / np.maximum(number, 1)
    return np.sqrt(np.where(number > 0, np.maximum(mean, 0.0), np.nan))


def styles(titles: list[str]) -> dict[str, dict[str, object]]:
    """By title: grey what does nothing, black what this project adds, the palette for the rest."""
    looks: dict[str, dict[str, object]] = {}
    others = [title for title in titles if title not in OUTSTANDING]
    for index, title in enumerate(others):
        look = palette.style(index)
        dash = "--" if "literal" in title else look.linestyle  # it lies upon the other form
        looks[title] = {"color": look.colour, "linestyle": dash, "linewidth": 1.2}
    looks["none"] = {"color": palette.TRUTH, "linewidth": 2.2}
    looks["noise_aware"] = {"color": "black", "linewidth": 1.6}
    return {title: looks[title] for title in titles}


def _plain(ax: Axes) -> None:
    """Numbers, not powers of ten."""
    from matplotlib.ticker import FuncFormatter

    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _symmetric(ax: Axes, linear: float) -> None:
    """Linear around zero, logarithmic beyond; ticks at powers of ten, and between on short axes."""
    low, high = ax.get_ylim()
    ax.set_yscale("symlog", linthresh=linear, linscale=0.6)
    ax.axhline(0.0, color="0.4", linewidth=0.6, zorder=0)
    sizes = linear * 10.0 ** np.arange(6)
    if max(-low, high) < 10.0 * linear:
        sizes = np.concatenate([[0.5 * linear], sizes])
    ticks = np.concatenate([-sizes[::-1], [0.0], sizes])
    ax.set_yticks(ticks[(ticks >= low) & (ticks <= high)])
    ax.set_ylim(low, high)
    _plain(ax)


def draw(title: str, runs: Mapping[str, Along], moving_from: float) -> bytes:
    """A PNG picture: error, weakest eigenvalue, velocity, bias and correction along the axis.

    Args:
        title: stands above the panels.
        runs: by their titles, in the legend's order.
        moving_from: s, where the standstill ends.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_RC):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        FigureCanvasAgg(figure)
        axes = list(figure.subplots(5, 1, sharex=True, height_ratios=[1.3, 1, 1.1, 1.2, 1]))
        _panels(axes, runs)
        for ax in axes:
            ax.axvspan(0.0, moving_from, color="0.93", zorder=0)
        axes[0].text(0.5 * moving_from, 1.0, "at rest", ha="center", va="bottom", color="0.4",
                     transform=axes[0].get_xaxis_transform())  # fmt: skip
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(0.0, max(float(run.seconds[-1]) for run in runs.values()))
        figure.suptitle(title, fontsize=11)
        handles, labels = axes[3].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)
        return _png(figure)


def _png(figure: Figure) -> bytes:
    """A picture of few colours: a third of the size."""
    from PIL import Image

    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, dpi=DPI, format="png")
    image = Image.open(drawn).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    image.save(small, format="png", optimize=True)
    return small.getvalue()


def _panels(axes: list[Axes], runs: Mapping[str, Along]) -> None:
    error, weakest, velocity, bias, correction = axes
    looks = styles(list(runs))
    for title, run in runs.items():
        look = looks[title]
        error.plot(run.seconds, run.error, **look)
        weakest.plot(run.seconds, np.maximum(run.weakest, LEAST_LAMBDA), **look)
        velocity.plot(run.seconds, run.velocity, **look)
        bias.plot(run.seconds, run.bias, label=title, **look)
        correction.plot(run.seconds, 1e3 * rolling_rms(run.seconds, run.correction), **look)
    first = next(iter(runs.values()))
    bias.plot(first.seconds, first.bias_true, color="black", linestyle=":", label="true bias")
    error.set_ylabel("position error [m]")
    _symmetric(error, 0.1)
    weakest.set_ylabel("smallest λ$_t$ [points]")
    weakest.set_yscale("log")
    _plain(weakest)
    velocity.set_ylabel("velocity error [m/s]")
    _symmetric(velocity, 0.1)
    bias.set_ylabel("bias in effect [m/s²]")
    _symmetric(bias, 0.1)
    correction.set_ylabel("correction per scan,\nrms over 1 s [mm]")
    correction.set_yscale("log")
    _plain(correction)
    for ax in axes:
        ax.margins(x=0.0)
