# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The report of an ablation: one page that needs nothing else, tables and figures as files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from itertools import groupby
from pathlib import Path

from d2lio import __version__
from d2lio.ablate.results import RESULTS_FILE, SUITE_FILE, TIMINGS_FILE, Key, Results
from d2lio.ablate.suite import Suite, shipped
from d2lio.ablate.tables import POOLED_ID, Cell, Header, Table, build, metres
from d2lio.errors import DataError
from d2lio.output import replace_file
from d2lio.record import RunRecord
from d2lio.report import payload
from d2lio.report.embed import asset, fill, script_json
from d2lio.report.exports import FORMATS, TABLES_DIR, file_stems, write_tables
from d2lio.report.printed import FIGURES_DIR, write_figures
from d2lio.report.series import RunSeries, read_series

REPORT_FILE = "report.html"
COMPARISON = "compare"  # name of the suite that `d2lio compare` makes


def write(results: Results, out: Path) -> Path:
    """Writes OUT/report.html, OUT/tables and OUT/figures; the page's path.

    Raises:
        DataError: a table of the paper that does not exist.
    """
    tables = build(results)
    write_tables(results.suite.name, tables, out)
    series = {row.key: read_series(place) for row, place in payload.runs_with_files(results)}
    drawn = write_figures(results, tables, series, out)
    page = out / REPORT_FILE
    values = _texts(results, tables, drawn) | _data(results, tables, series)
    replace_file(page, fill(asset("ablation.html"), values))
    return page


def _texts(results: Results, tables: list[Table], drawn: list[Path]) -> dict[str, str]:
    failures = sum(row.status != "ok" for row in results.rows)
    return {
        "TITLE": escape(results.suite.title or results.suite.name),
        "SUMMARY": _summary(results, failures),
        "NOTES": "".join(f'<p class="fail">{escape(note)}</p>' for note in results.notes),
        "TABLES": "".join(_block(results, tables, i) for i, _ in enumerate(tables)),
        "PRIOR": escape(_with_prior(results)),
        "DIFFERENCES": escape(_about_differences(tables)),
        "MAP": escape(_about_map(results)),
        "FAILED": f"Failures ({failures})",
        "MADE": _made(results, drawn),
    }


def _data(results: Results, tables: list[Table], series: Mapping[Key, RunSeries]) -> dict[str, str]:
    """What the page's scripts draw, and the scripts."""
    meta = payload.meta(results, tables)
    points = payload.points_per_curve(len(series))
    curves = (
        f'<script type="application/json" id="sequence-{number}">'
        f"{script_json(payload.sequence_data(results, number, series, points))}</script>"
        for number, _ in enumerate(meta["sequences"])
    )
    return {
        "META": script_json(meta),
        "DATA": "\n".join(curves),
        "TABLE_CODE": asset("table.js"),
        "PAGE_CODE": asset("ablation.js"),
    }


def _summary(results: Results, failures: int) -> str:
    rows = results.rows
    sequences = len({row.sequence for row in rows})
    variants = len({row.variant for row in rows})
    simulated = sum(bool(row.scene) for row in rows)
    kind = "simulated sequences" if simulated == len(rows) else "sequences"
    text = (
        f"{escape(results.suite.description)} {len(rows)} runs: {variants} variants on {sequences} "
        f"{kind}, each run {_times(len({row.repeat for row in rows}))}; {failures} failed."
    )
    if simulated and results.suite.paper is not None:
        text += (
            " The simulated sequences bear the names of the paper's recordings; they imitate their"
            " kind of place and sensor, so the paper's numbers stand beside ours for orientation."
        )
    return text.strip()


def _times(count: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(count, f"{count} times")


def _with_prior(results: Results) -> str:
    found = [
        payload.title_of(results, variant.id)
        for variant in results.suite.variants
        if _method(results, variant.id) not in ("", "none")
    ]
    return f"With the prior or remapping: {', '.join(found)}." if found else ""


def _method(results: Results, variant: str) -> str:
    """The degeneracy method that a variant ran with, the host's own where the suite is silent."""
    own = [row for row in results.rows if row.variant == variant]
    for row in own:
        with suppress(DataError):
            record = RunRecord.load(results.out / row.directory)
            return record.params.get("degeneracy.method", "")
    return own[0].degeneracy if own else ""


def _about_differences(tables: list[Table]) -> str:
    if not any(table.baseline for table in tables):
        return "The suite names no baseline."
    return (
        "ATE by that of the baseline, same sequence and repeat: geometric mean over the repeats, "
        "with its bootstrap interval where there are five pairs or more. Left of 1 is better."
    )


def _about_map(results: Results) -> str:
    if any(s.simulate is not None for s in results.suite.sequences):
        return "The points are what can be seen of the simulated scene of the first repeat."
    return ""


def _block(results: Results, tables: list[Table], index: int) -> str:
    table = tables[index]
    stem = file_stems(results.suite.name, tables)[index]
    links = ", ".join(f'<a href="{TABLES_DIR}/{stem}{s}">{s[1:]}</a>' for s in FORMATS)
    heading = f"<h3>{escape(table.title)}</h3>" if len(tables) > 1 else ""
    said = index > 0 and table.rules == tables[index - 1].rules
    return (
        f'<section class="block">{heading}'
        f'<div class="scroll"><table class="results">{_head(table)}{_body(table)}</table></div>'
        f'<p class="dim">Sort by a column\'s title; point at or tap a cell for what lies behind '
        f"it. As a file: {links}.</p>"
        f"{'' if said else _signs(table)}</section>"
    )


def _signs(table: Table) -> str:
    rules = "".join(f"<li>{escape(rule)}</li>" for rule in table.rules)
    return (
        f"<details open><summary>What the signs mean</summary>"
        f'<ul class="rules">{rules}</ul></details>'
    )


def _marks(table: Table, header: Header, of_rows: bool) -> str:
    """Attributes that the filters use."""
    kind = "sequence" if (table.corner == "sequence") == of_rows else "variant"
    last = ' data-last="yes"' if header.id == POOLED_ID else ""
    return (
        f'data-kind="{kind}" data-name="{escape(header.title, quote=True)}" '
        f'data-group="{escape(header.group, quote=True)}"{last}'
    )


def _head(table: Table) -> str:
    cells = [f'<th aria-sort="none"><button>{escape(table.corner)}</button></th>']
    cells += [
        f'<th aria-sort="none" {_marks(table, column, of_rows=False)}>'
        f"<button>{escape(column.title)}</button></th>"
        for column in table.columns
    ]
    return f"<thead><tr>{''.join(cells)}</tr></thead>"


def _body(table: Table) -> str:
    lines = []
    order = 0
    for block, (group, rows) in enumerate(groupby(table.rows, key=lambda row: row.group)):
        for place, row in enumerate(rows):
            marks = f'data-order="{order + 1}" data-block="{block}"'
            last = ' data-last="yes"' if row.id == POOLED_ID else ""
            if place == 0 and group:
                lines.append(
                    f'<tr class="group" data-order="{order}" data-block="{block}"{last}>'
                    f'<th colspan="{1 + len(table.columns)}">{escape(group)}</th></tr>'
                )
            cells = "".join(_cell(table.cell(row, column)) for column in table.columns)
            lines.append(
                f"<tr {marks} {_marks(table, row, of_rows=True)}>"
                f"<th>{escape(row.title).replace('_', '_<wbr>')}</th>{cells}</tr>"
            )
            order += 2
    return f"<tbody>{''.join(lines)}</tbody>"


def _cell(cell: Cell) -> str:
    if not cell.text:
        return '<td data-value=""></td>'
    names = {"best": cell.bold, "lowest": cell.best, "fail": cell.failed, "pooled": not cell.stats}
    kinds = " ".join(name for name, given in names.items() if given)
    tip = escape("\n".join(cell.tooltip), quote=True)
    return (
        f'<td class="{kinds}" data-value="{_sort_value(cell)}" data-tip="{tip}" tabindex="0">'
        f"{_shown(cell)}</td>"
    )


def _sort_value(cell: Cell) -> str:
    if cell.stats is None:
        return "" if cell.difference is None else repr(cell.difference.percent)
    return "" if cell.stats.median is None else repr(cell.stats.median)


def _shown(cell: Cell) -> str:
    """The figure; in small what failed runs came to, and the paper's number."""
    text = escape(cell.text)
    if cell.stats is None:
        return text.replace(" [", "<br><small>[").replace("]", "]</small>")
    small = []
    if cell.failed and cell.stats.failed_ate is not None:
        small.append(f"lost, {metres(cell.stats.failed_ate)}")
    if cell.paper:
        small.append(f"paper {escape(cell.paper)}")
    return f"<b>{text}</b>" + "".join(f"<small>{line}</small>" for line in small)


def _made(results: Results, drawn: list[Path]) -> str:
    written = _date(results.out / RESULTS_FILE)
    versions = ", ".join(dict.fromkeys(row.version for row in results.rows if row.version))
    machines = dict.fromkeys(
        f"{t.cpu or 'unknown processor'}, {t.cores or '?'} cores" for t in results.timings.values()
    )
    facts = [
        ("Command", _command(results)),
        ("d2lio", versions or __version__),
        ("Results of", written),
        ("Machine", "; ".join(machines) or "unknown"),
        ("Time in runs", _hours(sum(t.wall_s or 0.0 for t in results.timings.values()))),
    ]
    lines = "".join(f"<tr><th>{a}</th><td>{escape(b)}</td></tr>" for a, b in facts)
    files = [f for f in (RESULTS_FILE, TIMINGS_FILE, SUITE_FILE) if (results.out / f).exists()]
    links = ", ".join(f'<a href="{f}">{f}</a>' for f in files)
    figures = ", ".join(
        f'<a href="{FIGURES_DIR}/{escape(f.name, quote=True)}">{escape(f.name)}</a>' for f in drawn
    )
    return (
        f'<div class="scroll"><table class="left">{lines}</table></div>'
        f"<p>Data: {links or 'none'}.</p><p>Figures: {figures or 'none'}.</p>"
        f"<p>The suite as it was run:</p><pre>{escape(results.suite.to_yaml())}</pre>"
    )


def _command(results: Results) -> str:
    """What makes the same ablation again; the suite that was run lies beside the page."""
    if results.suite.name == COMPARISON:
        ids = ",".join(variant.id for variant in results.suite.variants)
        return f"d2lio compare {results.suite.sequences[0].name}: {ids}"
    known = shipped().get(results.suite.name)
    if known is not None and Suite.load(known) == results.suite:
        return f"d2lio ablate {results.suite.name}"
    return f"d2lio ablate {SUITE_FILE}"


def _date(file: Path) -> str:
    if not file.exists():
        return "unknown date"
    return datetime.fromtimestamp(file.stat().st_mtime, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _hours(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "unknown"
    return f"{seconds / 60.0:.0f} min" if seconds >= 120.0 else f"{seconds:.0f} s"
