# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Plotly figures as plain dictionaries, small enough for a phone."""

from __future__ import annotations

from typing import Any

import numpy as np

from d2lio.demo import DemoResult, Row, Scene, Variant
from d2lio.hosts import TITLES
from d2lio.report import palette
from d2lio.report.diagnostics import OUTCOMES, processed, read_diagnostics, seconds_from_start

MAX_POINTS = 400  # per curve
COLOURS = {
    "fastlio": {
        "off": "#888888",
        "none": "#d1495b",
        "fixed": "#e58606",
        "kiss": "#2f7ebc",
        "point_adaptive": "#2a9d4a",
    },
    "liosam": {"off": "#7b4fa3", "point_adaptive": "#c77dff"},
    "d2lio": {"off": "#8c6d31", "point_adaptive": "#00a6b8"},
}
OTHER_COLOUR = "#b0508f"
SHOWN = (  # at first: every host as it is, and what this project adds to it
    Variant("off", "none"),
    Variant("point_adaptive", "paper"),
    Variant("off", "none", "liosam"),
    Variant("point_adaptive", "paper", "d2lio"),
)
STAGES = ("preprocess", "deskew", "downsample", "search", "update", "map")

Figure = dict[str, Any]
Columns = dict[str, np.ndarray]


def line_style(variant: Variant) -> dict[str, str]:
    """Colour by host and rejection mode, dashes for the prior."""
    return {
        "color": COLOURS.get(variant.host, {}).get(variant.rejection, OTHER_COLOUR),
        "dash": "solid" if variant.degeneracy == "none" else "dash",
    }


def variant_buttons(result: DemoResult) -> list[dict[str, Any]]:
    """What the page needs to draw one button per variant, by host."""
    return [
        {
            "label": v.label,
            "host": TITLES.get(v.host, v.host),
            "text": v.rejection + ("" if v.degeneracy == "none" else " + prior"),
            "colour": line_style(v)["color"],
            "dashed": v.degeneracy != "none",
            "shown": v in SHOWN,
        }
        for v in result.variants
    ]


def thin(values: np.ndarray, digits: int = 5) -> list[float | None]:
    """At most MAX_POINTS values with `digits` significant digits, None where not finite."""
    step = max(1, -(-len(values) // MAX_POINTS))
    return [
        float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in np.asarray(values)[::step]
    ]


def _pale(colour: str) -> str:
    """A colour #rrggbb, nearly transparent."""
    channels = ", ".join(str(int(colour[i : i + 2], 16)) for i in (1, 3, 5))
    return f"rgba({channels}, 0.18)"


def _curve(name: str, x: np.ndarray, y: np.ndarray, row: Row | None, **extra: Any) -> Figure:
    line = {"width": 1.6, "color": palette.TRUTH}
    if row is not None:
        line |= line_style(row.variant)
        extra["meta"] = row.variant.label
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": thin(x),
        "y": thin(y),
        "line": line,
        **extra,
    }


def _figure(title: str, x: str, y: str, data: list[Figure], **layout: Any) -> Figure:
    return {
        "data": data,
        "layout": {
            "title": {"text": title},
            "showlegend": False,
            "xaxis": {"title": {"text": x, "standoff": 6}},
            "yaxis": {"title": {"text": y}},
            **layout,
        },
    }


def _scored(result: DemoResult, scene: Scene) -> list[Row]:
    rows = (result.row(scene, variant) for variant in result.variants)
    return [row for row in rows if row is not None and row.curves is not None]


def trajectories(result: DemoResult, scene: Scene) -> list[Figure]:
    """Top view and side view of every scored run beside the truth."""
    rows = _scored(result, scene)
    figures = []
    for title, axis in (("Top view", 1), ("Side view", 2)):
        data = []
        for row in rows:
            if row.curves is None:
                continue
            if not data:
                truth = row.curves.truth
                wide = _curve("truth", truth[:, 0], truth[:, axis], None)
                wide["line"]["width"] = 5
                data.append(wide)
            estimate = row.curves.estimate
            data.append(_curve(row.variant.label, estimate[:, 0], estimate[:, axis], row))
        figure = _figure(f"{title}, aligned", "x [m]", f"{'xyz'[axis]} [m]", data)
        if axis == 1:
            figure["layout"]["yaxis"]["scaleanchor"] = "x"
        figures.append(figure)
    return figures


def error_over_time(result: DemoResult, scene: Scene) -> Figure:
    """Translation error after alignment."""
    data = [
        _curve(row.variant.label, row.curves.t, row.curves.error, row)
        for row in _scored(result, scene)
        if row.curves is not None
    ]
    figure = _figure("Translation error", "time [s]", "error [m]", data)
    figure["layout"]["yaxis"]["type"] = "log"
    return figure


def diagnostics_of(result: DemoResult, scene: Scene) -> list[tuple[Row, Columns]]:
    """Diagnostics of every run of a scene that left some."""
    found = []
    for variant in result.variants:
        row = result.row(scene, variant)
        if row is not None and row.record is not None:
            columns = processed(read_diagnostics(row.directory / "diagnostics.csv"))
            if len(columns.get("stamp_ns", ())):
                found.append((row, columns))
    return found


def lambda_min(runs: list[tuple[Row, Columns]]) -> list[Figure]:
    """Smallest eigenvalue of each block over time (the paper's figure)."""
    figures = []
    for block, name in (("t", "translation"), ("r", "rotation")):
        key = f"lambda_{block}_1"
        data = [
            _curve(row.variant.label, seconds_from_start(c), c[key], row)
            for row, c in runs
            if key in c
        ]
        unit = "points" if block == "t" else "points·m²"
        figure = _figure(f"λ_min, {name} block", "time [s]", f"λ_min [{unit}]", data)
        figure["layout"]["yaxis"]["type"] = "log"
        figures.append(figure)
    return figures


def thresholds(runs: list[tuple[Row, Columns]]) -> Figure:
    """Median acceptance radius ε over time, with its range for the point-adaptive mode."""
    data: list[Figure] = []
    for row, columns in runs:
        if row.variant.rejection not in ("fixed", "kiss", "point_adaptive"):
            continue
        t = seconds_from_start(columns)
        data.append(_curve(f"{row.variant.label}, median", t, columns["epsilon_median"], row))
        if row.variant.rejection == "point_adaptive":
            low = _curve("min", t, columns["epsilon_min"], row)
            high = _curve("max", t, columns["epsilon_max"], row, fill="tonexty")
            for edge in (low, high):
                edge["line"]["width"] = 0
            high["fillcolor"] = _pale(high["line"]["color"])
            data += [low, high]
    return _figure("Acceptance radius ε", "time [s]", "ε [m]", data)


def rejections(runs: list[tuple[Row, Columns]]) -> Figure:
    """Share of offered correspondences accepted and rejected, by reason."""
    names = _labels(runs)
    data = []
    for key, label in OUTCOMES.items():
        shares = [
            100.0 * float(np.nansum(c[key])) / max(float(np.nansum(c["offered"])), 1.0)
            for _, c in runs
            if key in c
        ]
        if len(shares) == len(names):
            data.append({"type": "bar", "orientation": "h", "name": label, "x": shares, "y": names})
    return _bars("Correspondences by outcome", "share [%]", data, palette.OUTCOME_COLOURS)


def timing(runs: list[tuple[Row, Columns]]) -> Figure:
    """Median time per scan by stage."""
    names = _labels(runs)
    data = []
    for stage in STAGES:
        medians = [
            row.record.time_ms[stage].median
            for row, _ in runs
            if row.record is not None and stage in row.record.time_ms
        ]
        if len(medians) == len(names):
            data.append(
                {"type": "bar", "orientation": "h", "name": stage, "x": medians, "y": names}
            )
    return _bars("Time per scan by stage", "median [ms]", data, palette.STAGE_COLOURS)


def _labels(runs: list[tuple[Row, Columns]]) -> list[str]:
    return [row.variant.label for row, _ in runs]


def _bars(title: str, x: str, data: list[Figure], colours: tuple[str, ...]) -> Figure:
    for index, bar in enumerate(data):
        bar["by_variant"] = True  # the page shows the bars of the variants chosen
        bar["x"] = thin(np.asarray(bar["x"]))
        bar["marker"] = {"color": colours[index % len(colours)]}
    figure = _figure(title, x, "", data, barmode="stack")
    figure["layout"]["yaxis"] = {"autorange": "reversed", "automargin": True}
    figure["layout"]["showlegend"] = True
    return figure
