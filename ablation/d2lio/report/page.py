# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Puts table and figures into one HTML file that needs nothing else."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path
from typing import Any

from d2lio import __version__
from d2lio.demo import RESULTS_FILE, DemoResult, Scene, cell
from d2lio.metrics import FAIL_PERCENT
from d2lio.output import replace_file
from d2lio.report import figures
from d2lio.report.embed import asset, fill, script_json


def _table(result: DemoResult) -> str:
    head = "".join(f'<th colspan="3">{escape(s.title)}</th>' for s in result.scenes)
    width = 1 + 3 * len(result.scenes)
    units = "<th>ATE [m]</th><th>accepted</th><th>ms/scan</th>" * len(result.scenes)
    lines = [f"<thead><tr><th></th>{head}</tr><tr><th>rejection</th>{units}</tr></thead><tbody>"]
    best = {scene: _best(result, scene) for scene in result.scenes}
    former = ""
    for variant in result.variants:
        if variant.group != former:
            former = variant.group
            lines.append(f'<tr class="group"><th colspan="{width}">{escape(former)}</th></tr>')
        tds = []
        for scene in result.scenes:
            row = result.row(scene, variant)
            ate, share, ms = ("-", "-", "-") if row is None else cell(row)
            kind = "best" if row is not None and row is best[scene] else ""
            if row is not None and row.status != "ok":
                kind = "fail"
            why = escape(row.reason, quote=True) if row is not None else ""
            tds.append(f'<td class="{kind}" title="{why}">{escape(ate)}</td>')
            tds.append(f'<td class="dim">{share}</td><td class="dim">{ms}</td>')
        lines.append(f"<tr><th>{escape(variant.rejection)}</th>{''.join(tds)}</tr>")
    return "".join(lines) + "</tbody>"


def _best(result: DemoResult, scene: Scene) -> Any:
    rows = (result.row(scene, variant) for variant in result.variants)
    scored = [r for r in rows if r is not None and r.status == "ok" and r.ate is not None]
    return min(scored, key=lambda r: r.ate or 0.0, default=None)


def _failures(result: DemoResult) -> str:
    failed = [row for row in result.rows if row.status != "ok"]
    if not failed:
        return ""
    items = "".join(
        f"<li>{escape(r.scene.title)}, {escape(r.variant.label)}: {escape(r.reason)}</li>"
        for r in failed
    )
    return f"<details><summary>{len(failed)} runs shown as -</summary><ul>{items}</ul></details>"


def _files(result: DemoResult) -> str:
    base = result.out
    items = "".join(
        f'<li><a href="{escape(os.path.relpath(r.directory, base), quote=True)}/">'
        f"{escape(r.scene.title)}, {escape(r.variant.label)}</a></li>"
        for r in result.rows
        if r.record is not None
    )
    return (
        f'<details><summary>Files</summary><ul><li><a href="{RESULTS_FILE}">{RESULTS_FILE}</a>'
        f"</li>{items}</ul></details>"
    )


def _scene(result: DemoResult, scene: Scene) -> dict[str, Any]:
    runs = figures.diagnostics_of(result, scene)
    plots = [
        *figures.trajectories(result, scene),
        figures.error_over_time(result, scene),
        *figures.lambda_min(runs),
        figures.thresholds(runs),
        figures.rejections(runs),
        figures.timing(runs),
    ]
    return {
        "id": scene.name,
        "title": scene.title,
        "params": ", ".join(scene.params),
        "figures": [p for p in plots if p["data"]],
    }


def write_report(result: DemoResult, path: Path) -> None:
    """Writes the page in one go."""
    scenes = [_scene(result, scene) for scene in result.scenes]
    values = {
        "VERSION": escape(__version__),
        "FAIL_PERCENT": f"{FAIL_PERCENT:g}",
        "TABLE": _table(result),
        "NOTE": escape(result.note and f"Left out: {result.note}."),
        "FAILURES": _failures(result),
        "FILES": _files(result),
        "VARIANTS": script_json(figures.variant_buttons(result)),
        "SCENES": script_json(scenes),
    }
    replace_file(path, fill(asset("template.html"), values))
