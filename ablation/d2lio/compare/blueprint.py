# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How the viewer arranges a comparison when it opens."""

from __future__ import annotations

from typing import Any

from d2lio.compare.tracks import Track

PLOTS = {
    "error": "Distance to the truth, m",
    "lambda": "Smallest eigenvalue of the translation, log10",
    "rejected": "Rejected correspondences, %",
    "time": "Time per scan, ms",
}
WITH_LEGEND = "error"
TIMELINE = "time"
GRID_COLUMNS = 2
BACKGROUND = (16, 18, 22)


def make(tracks: list[Track]) -> Any:
    """One view with all variants, one for each, four plots and the scoreboard."""
    import rerun.blueprint as rrb

    together = _view(rrb, "All variants", tracks)
    apart = [_view(rrb, track.title, [track]) for track in tracks]
    plots = [
        rrb.TimeSeriesView(
            origin=f"/plots/{key}",
            name=name,
            plot_legend=rrb.PlotLegend(visible=key == WITH_LEGEND),  # it covers curves
        )
        for key, name in PLOTS.items()
    ]
    left = rrb.Tabs(
        together, rrb.Grid(*apart, grid_columns=GRID_COLUMNS, name="Side by side"), active_tab=0
    )
    board = rrb.TextDocumentView(origin="/scoreboard", name="Scoreboard")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(left, board, row_shares=[3, 1]),
            rrb.Vertical(*plots),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )


def _view(rrb: Any, name: str, tracks: list[Track]) -> Any:
    """A 3-D view; paths are drawn from the start to the moment shown, all else at that moment."""
    so_far = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin="/world",
        name=name,
        background=BACKGROUND,
        contents=["/world/truth/**", "/world/map", *(f"/world/{track.id}/**" for track in tracks)],
        overrides={
            f"/world/{track.id}/path": rrb.archetypes.VisibleTimeRanges([so_far])
            for track in tracks
        },
    )
