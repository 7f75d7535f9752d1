# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The figures of an ablation as PNG, SVG and PDF files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from d2lio.ablate.results import Key, Results
from d2lio.ablate.statistics import CellStats
from d2lio.ablate.tables import POOLED_ID, Header, Table
from d2lio.report import palette, payload
from d2lio.report.series import RunSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES_DIR = "figures"
SUFFIXES = (".png", ".svg", ".pdf")
COLUMNS = 4  # of small figures beside each other
PANEL_INCHES = (3.4, 2.5)
DPI = 130
MAX_LINEAR_RATIO = 20.0  # of bars in one panel

_RC = {
    "font.size": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "svg.fonttype": "none",
    "legend.frameon": False,
}


def write_figures(
    results: Results, tables: Sequence[Table], series: Mapping[Key, RunSeries], out: Path
) -> list[Path]:
    """Draws what the suite asks for and what there is data for; the files written.

    Curves are those of each sequence's first repeat.
    """
    import matplotlib as mpl

    figures: dict[str, Figure | None] = {}
    with mpl.rc_context(_RC):
        if results.suite.figures.trajectories:
            figures["trajectories_top"] = _curves(results, series, "top")
            figures["trajectories_side"] = _curves(results, series, "side")
            figures["error"] = _curves(results, series, "error")
        if results.suite.figures.lambda_min:
            figures["lambda_min_translation"] = _curves(results, series, "lambda_t")
            figures["lambda_min_rotation"] = _curves(results, series, "lambda_r")
        for number, table in enumerate(tables, start=1):
            name = "ate" if len(tables) == 1 else f"ate_{number}"
            figures[name] = _ate(results, table)
        figures["timing"] = _timing(results)
        return _save({k: v for k, v in figures.items() if v is not None}, out / FIGURES_DIR)


def _save(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in figures.items():
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # as it is now: laying out takes longer than drawing
        for suffix in SUFFIXES:
            file = folder / f"{name}{suffix}"
            figure.savefig(file, dpi=DPI)
            written.append(file)
    return written


def _new(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure without a window behind it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    figure.get_layout_engine().set(h_pad=0.1)  # titles above panels of equal scales are cut else
    FigureCanvasAgg(figure)
    return figure, list(np.ravel(figure.subplots(rows, columns, squeeze=False)))


def _grid(count: int, height: float = PANEL_INCHES[1]) -> tuple[Figure, list[Axes]]:
    """So many panels, COLUMNS beside each other."""
    columns = min(COLUMNS, count)
    rows = math.ceil(count / columns)
    figure, axes = _new(rows, columns, (PANEL_INCHES[0] * columns, height * rows + 0.5))
    for ax in axes[count:]:
        ax.remove()
    return figure, axes[:count]


def _styles(results: Results) -> dict[str, palette.Style]:
    """By variant, as the page has them."""
    present = {row.variant for row in results.rows}
    variants = [v.id for v in results.suite.variants if v.id in present]
    return {variant: palette.style(index) for index, variant in enumerate(variants)}


_LABELS = {
    "top": ("x [m]", "y [m]"),
    "side": ("x [m]", "z [m]"),
    "error": ("time [s]", "error [m]"),
    "lambda_t": ("time [s]", "λ_min, translation [points]"),
    "lambda_r": ("time [s]", "λ_min, rotation [points·m²]"),
}


def _line(run: RunSeries, kind: str) -> tuple[np.ndarray, np.ndarray]:
    if kind in ("top", "side"):
        return run.path[:, 0], run.path[:, 1 if kind == "top" else 2]
    if kind == "error":
        return run.t, run.error
    return run.t_scan, getattr(run, kind)


def _curves(results: Results, series: Mapping[Key, RunSeries], kind: str) -> Figure | None:
    """Small figures, one per sequence; None where no run has such a curve."""
    panels = _panels(results, series, kind)
    if not panels:
        return None
    figure, axes = _grid(len(panels))
    styles = _styles(results)
    for ax, (name, runs) in zip(axes, panels.items(), strict=True):
        _panel(ax, name, runs, kind, styles)
    used = dict.fromkeys(variant for runs in panels.values() for variant in runs)
    _legend(figure, results, [v for v in styles if v in used])
    return figure


def _panels(
    results: Results, series: Mapping[Key, RunSeries], kind: str
) -> dict[str, dict[str, RunSeries]]:
    """Sequence → variant → the first repeat's run, where it has the curve."""
    first: dict[str, int] = {}
    panels: dict[str, dict[str, RunSeries]] = {}
    for row in results.rows:
        repeat = first.setdefault(row.sequence, row.repeat)
        run = series.get(row.key)
        if run is None or row.repeat != repeat:
            continue
        y = _line(run, kind)[1]
        if len(y) and np.isfinite(y).any():
            panels.setdefault(row.sequence, {})[row.variant] = run
    return panels


def _panel(
    ax: Axes,
    name: str,
    runs: Mapping[str, RunSeries],
    kind: str,
    styles: Mapping[str, palette.Style],
) -> None:
    ax.set_title(name)
    ax.set_xlabel(_LABELS[kind][0])
    ax.set_ylabel(_LABELS[kind][1])
    if kind in ("top", "side"):
        truth = next(iter(runs.values())).truth
        x, y = truth[:, 0], truth[:, 1 if kind == "top" else 2]
        ax.plot(x, y, color=palette.TRUTH, linewidth=4, alpha=0.6)
        ranges = _roomy(x), _roomy(y)
        if kind == "top":
            ranges = _equal(*ranges)
            ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(*ranges[0])
        ax.set_ylim(*ranges[1])
    else:
        _logarithmic(ax, "y")
    for variant, run in runs.items():
        look = styles[variant]
        x, y = _line(run, kind)
        ax.plot(x, y, color=look.colour, linestyle=look.linestyle, linewidth=1.1)


def _logarithmic(ax: Axes, name: Literal["x", "y"]) -> None:
    """A logarithmic axis with plain numbers at 1, 2 and 5."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_xscale("log") if name == "x" else ax.set_yscale("log")
    axis = ax.xaxis if name == "x" else ax.yaxis
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _roomy(values: np.ndarray) -> tuple[float, float]:
    """A range with a margin: a lost run leaves it."""
    low, high = float(values.min()), float(values.max())
    margin = max(0.15 * (high - low), 1.0)
    return low - margin, high + margin


def _equal(
    x: tuple[float, float], y: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """The shorter range widened to the shape of a panel, so that equal scales fill it."""
    wide, high = x[1] - x[0], y[1] - y[0]
    shape = PANEL_INCHES[1] / PANEL_INCHES[0]
    more_x, more_y = max(0.0, high / shape - wide) / 2.0, max(0.0, wide * shape - high) / 2.0
    return (x[0] - more_x, x[1] + more_x), (y[0] - more_y, y[1] + more_y)


def _legend(figure: Figure, results: Results, variants: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    styles = _styles(results)
    handles = [
        Line2D([], [], color=styles[v].colour, linestyle=styles[v].linestyle) for v in variants
    ]
    labels = [payload.title_of(results, v) for v in variants]
    width = figure.get_size_inches()[0]
    figure.legend(handles, labels, loc="outside lower center", ncols=max(1, int(width / 1.9)))


def _ate(results: Results, table: Table) -> Figure | None:
    """A panel per sequence, a bar per variant: median, and span of the good runs."""
    of_sequences = table.corner == "sequence"
    sequences, variants = table.rows, table.columns
    if not of_sequences:
        sequences, variants = variants, sequences
    sequences = [s for s in sequences if s.id != POOLED_ID]
    if not sequences or not variants:
        return None
    styles = _styles(results)
    figure, axes = _grid(len(sequences), height=2.1)
    for ax, sequence in zip(axes, sequences, strict=True):
        ax.set_title(sequence.title)
        ax.set_ylabel("ATE [m]")
        ax.grid(axis="x", visible=False)
        ax.set_xticks([])
        ax.set_xlim(-0.6, len(variants) - 0.4)
        order = [(sequence.id, v.id) if of_sequences else (v.id, sequence.id) for v in variants]
        stats = [table.cells[key].stats if key in table.cells else None for key in order]
        _bars(ax, stats, [styles[v.id] for v in variants])
    _bar_legend(figure, variants, styles)
    return figure


def _bars(ax: Axes, stats: Sequence[CellStats | None], looks: Sequence[palette.Style]) -> None:
    """Bars from zero; logarithmic only where some could not be seen then."""
    medians = [s.median for s in stats if s is not None and s.median]
    if medians and max(medians) > MAX_LINEAR_RATIO * min(medians):
        _logarithmic(ax, "y")
        ax.set_ylim(bottom=min(medians) / 3.0)
    for x, (cell, look) in enumerate(zip(stats, looks, strict=True)):
        if cell is not None:
            _bar(ax, x, cell, look)


def _bar(ax: Axes, x: float, stats: CellStats, look: palette.Style) -> None:
    if stats.median is None:
        place = {"transform": ax.get_xaxis_transform(), "ha": "center", "va": "bottom"}
        ax.text(x, 0.03, "failed", rotation=90, color=look.colour, **place)
        return
    ax.bar(x, stats.median, 0.8, color=look.colour, hatch=look.hatch, edgecolor="white")
    if stats.low is not None and stats.high is not None and stats.n > 1:
        low, high = min(stats.low, stats.median), max(stats.high, stats.median)
        error = [[stats.median - low], [high - stats.median]]
        ax.errorbar(x, stats.median, error, color="#444444", linewidth=0.8, capsize=1.5)


def _bar_legend(
    figure: Figure, variants: Sequence[Header], styles: Mapping[str, palette.Style]
) -> None:
    from matplotlib.patches import Patch

    looks = [styles[v.id] for v in variants]
    handles = [Patch(facecolor=x.colour, hatch=x.hatch, edgecolor="white") for x in looks]
    columns = max(1, int(figure.get_size_inches()[0] / 1.9))
    labels = [v.title for v in variants]
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _timing(results: Results) -> Figure | None:
    """Median time per scan of every run, a box per variant."""
    values: dict[str, list[float]] = {}
    for variant in _styles(results):
        found = [
            t.ms_per_scan_median
            for key, t in results.timings.items()
            if key[2] == variant and t.ms_per_scan_median is not None
        ]
        if found:
            values[variant] = found
    if not values:
        return None
    figure, (ax,) = _new(1, 1, (5.0, 1.0 + 0.26 * len(values)))
    boxes = ax.boxplot(list(values.values()), orientation="horizontal", patch_artist=True)
    for variant, box, median in zip(values, boxes["boxes"], boxes["medians"], strict=True):
        box.set_facecolor(_styles(results)[variant].colour)
        median.set_color("#222222")
    labels = [payload.title_of(results, v) for v in values]
    ax.set_yticks(range(1, len(values) + 1), labels)
    ax.invert_yaxis()
    _logarithmic(ax, "x")
    ax.set_xlabel("median time per scan of a run [ms]")
    return figure
