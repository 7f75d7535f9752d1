# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The tables of an ablation: medians over the repeats beside the paper's numbers."""

from __future__ import annotations

import csv
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import TYPE_CHECKING

from d2lio.ablate.results import ResultRow, Results
from d2lio.ablate.statistics import (
    CONFIDENCE,
    MIN_PAIRS,
    CellStats,
    Difference,
    compare,
    pooled,
    summarise,
)
from d2lio.errors import DataError
from d2lio.hosts import SHORT_TITLES
from d2lio.metrics import FAIL_PERCENT
from d2lio.metrics.evaluate import MIN_COVERAGE

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from d2lio.ablate.suite import Suite, Variant

FAILED = "-"
POOLED_ID = "*"
PAPER_SOURCE = (
    "G. Yao, H. Wang, Q. Chang: D²-LIO: Enhanced Optimization for LiDAR-IMU Odometry "
    "Considering Directional Degeneracy"
)


@dataclass(frozen=True, slots=True)
class Header:
    """Of a row or column: `group` is a sequence's data set, or a variant's group or host."""

    id: str
    title: str
    group: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    """A sequence and a variant, or a variant pooled over the sequences.

    Attributes:
        text: what stands there; empty where the variant does not run on the sequence.
        paper: the paper's number as printed there, empty where it has none.
        bold: by the rule that the caption states; best: the lowest median of the sequence.
        stats: None for a pooled cell; difference: to the baseline.
    """

    text: str = ""
    paper: str = ""
    bold: bool = False
    best: bool = False
    stats: CellStats | None = None
    difference: Difference | None = None

    @property
    def failed(self) -> bool:
        """Whether no number is left after the failures."""
        return self.stats is not None and self.stats.median is None

    @property
    def tooltip(self) -> list[str]:
        """What lies behind the text, line by line."""
        return _tooltip(self)


@dataclass(slots=True)
class Table:
    """One block of results.

    Attributes:
        baseline: id of the variant that differences refer to; empty where there is none.
        cells: by (row id, column id); `rows` and `columns` give order and titles.
        rules: what the signs mean, sentence by sentence.
    """

    title: str
    corner: str
    rows: list[Header]
    columns: list[Header]
    baseline: str = ""
    cells: dict[tuple[str, str], Cell] = field(default_factory=dict)
    rules: list[str] = field(default_factory=list)

    def cell(self, row: Header, column: Header) -> Cell:
        """The cell there; an empty one where nothing ran."""
        return self.cells.get((row.id, column.id), Cell())


def build(results: Results) -> list[Table]:
    """The tables of a suite: one, or one for each group of variants that has results."""
    suite = results.suite
    if suite.layout.blocks == "none":
        blocks = [("", list(suite.variants))]
    else:
        groups = dict.fromkeys(variant.group for variant in suite.variants)
        blocks = [(g, [v for v in suite.variants if v.group == g]) for g in groups]
    tables = [_block(results, title, variants) for title, variants in blocks]
    return [table for table in tables if table.cells]


def _block(results: Results, group: str, variants: list[Variant]) -> Table:
    suite = results.suite
    ids = [variant.id for variant in variants]
    runs: dict[tuple[str, str], list[ResultRow]] = {}
    for row in results.rows:
        if row.variant in ids:
            runs.setdefault((row.sequence, row.variant), []).append(row)
    present = {variant for _, variant in runs}
    names = {sequence for sequence, _ in runs}
    shown = [v for v in variants if v.id in present]
    sequences = [Header(s.name, s.name, s.dataset) for s in suite.sequences if s.name in names]
    columns = [Header(v.id, v.label, _host(v)) for v in shown]
    baseline = _baseline(suite, shown, in_groups=bool(group))
    cells = _cells(runs, sequences, columns, baseline)
    _add_paper(cells, suite, {v.id: v for v in shown})
    pool = _pooled(cells, sequences, columns, baseline)
    if pool:
        label = next(c.title for c in columns if c.id == baseline)
        sequences.append(Header(POOLED_ID, "all sequences", f"difference to {label}"))
        cells |= pool
    title = ": ".join(filter(None, (suite.title or suite.name, group)))
    table = Table(title, "sequence", sequences, columns, baseline, cells)
    table.rules = _rules(table, runs)
    return _transposed(table) if suite.layout.rows == "variant" else table


def _host(variant: Variant) -> str:
    return variant.group or SHORT_TITLES.get(variant.host or "", variant.host or "imported")


def _baseline(suite: Suite, variants: list[Variant], in_groups: bool) -> str:
    """The suite's baseline, or in another group the variant of the same title or settings."""
    if suite.baseline is None:
        return ""
    wanted = suite.variant(suite.baseline)
    if not in_groups:
        return wanted.id if wanted in variants else ""
    alike = (
        lambda v: v.id == wanted.id,
        lambda v: v.label == wanted.label,
        lambda v: (
            bool(wanted.rejection)
            and (v.rejection, v.degeneracy) == (wanted.rejection, wanted.degeneracy)
        ),
    )
    return next((v.id for test in alike for v in variants if test(v)), "")


def _cells(
    runs: Mapping[tuple[str, str], list[ResultRow]],
    sequences: list[Header],
    columns: list[Header],
    baseline: str,
) -> dict[tuple[str, str], Cell]:
    cells = {}
    for sequence in sequences:
        own = {c.id: runs[sequence.id, c.id] for c in columns if (sequence.id, c.id) in runs}
        scored = {variant: summarise(rows) for variant, rows in own.items()}
        medians = {v: s.median for v, s in scored.items() if s.median is not None}
        best = min(medians, key=lambda v: medians[v], default="")
        for variant, rows in own.items():
            reference = own.get(baseline) if variant != baseline else None
            difference = compare(rows, reference) if reference else None
            cells[sequence.id, variant] = Cell(
                text=_text(scored[variant]),
                bold=variant in medians
                and difference is not None
                and difference.better
                and (variant == best or not _separable(rows, own[best])),
                best=variant == best,
                stats=scored[variant],
                difference=difference,
            )
    return cells


def _separable(rows: list[ResultRow], best: list[ResultRow]) -> bool:
    difference = compare(rows, best)
    return difference is None or difference.worse or difference.better


def metres(value: float) -> str:
    """Three decimals below ten metres, fewer above."""
    return f"{value:.3f}" if value < 10.0 else f"{value:.1f}"


def _text(stats: CellStats) -> str:
    if stats.median is None:
        return FAILED
    failures = f" ({stats.failures})" if stats.failures else ""
    return metres(stats.median) + failures


def _pooled(
    cells: Mapping[tuple[str, str], Cell],
    sequences: list[Header],
    columns: list[Header],
    baseline: str,
) -> dict[tuple[str, str], Cell]:
    """Differences over all sequences; none for a single one or without a baseline."""
    found: dict[tuple[str, str], Cell] = {}
    if not baseline or len(sequences) < 2:
        return found
    for column in columns:
        of_variant = {s.id: cells[s.id, column.id] for s in sequences if (s.id, column.id) in cells}
        difference = pooled({name: cell.difference for name, cell in of_variant.items()})
        if difference is not None:
            found[POOLED_ID, column.id] = Cell(
                difference.text(), bold=difference.better, difference=difference
            )
    return found


def _transposed(table: Table) -> Table:
    table.corner, table.rows, table.columns = "variant", table.columns, table.rows
    table.cells = {(column, row): cell for (row, column), cell in table.cells.items()}
    return table


def paper_table(name: str) -> list[dict[str, str]]:
    """A table of the paper as shipped.

    Raises:
        DataError: no such table.
    """
    source = files("d2lio.ablate").joinpath("paper", name)
    if not source.is_file():
        raise DataError(f"{name}: no such table of the paper")
    return list(csv.DictReader(source.read_text(encoding="utf-8").splitlines()))


def _add_paper(
    cells: dict[tuple[str, str], Cell], suite: Suite, variants: Mapping[str, Variant]
) -> None:
    """Puts the paper's numbers beside ours, in place."""
    if suite.paper is None:
        return
    lines = paper_table(suite.paper.table)
    for (sequence, identifier), cell in list(cells.items()):
        column = suite.paper.columns.get(identifier)
        host = SHORT_TITLES.get(variants[identifier].host or "")
        for line in lines:
            same_host = line.get("host") in (None, host)
            if column is not None and line["sequence"] == sequence and same_host:
                cells[sequence, identifier] = replace(cell, paper=line.get(column, ""))


def _rules(table: Table, runs: Mapping[tuple[str, str], list[ResultRow]]) -> list[str]:
    counts = sorted({len(rows) for rows in runs.values()})
    times = " to ".join(str(n) for n in dict.fromkeys((counts[0], counts[-1]))) if counts else "0"
    cells = table.cells.values()
    rules = [
        f"ATE RMSE in metres after SE(3) alignment: the median of n = {times} runs, a failed run "
        f"counting as worse than every other; (k): k of them failed.",
        f"{FAILED}: no median is left. A run fails by a crash, its limit of time or memory, "
        f"divergence, a coverage below {100 * MIN_COVERAGE:g} % or an ATE beyond "
        f"{FAIL_PERCENT:g} % of the path.",
    ]
    if any(cell.paper for cell in cells):
        rules.append(
            "Beside ours, after the stroke or in small: the paper's number on the recording of "
            f"that name ({PAPER_SOURCE})."
        )
    if table.baseline:
        label = next(c.title for c in table.columns if c.id == table.baseline)
        rules.append(_bold_rule(label))
        if any(row.id == POOLED_ID for row in table.rows):
            rules.append(
                "All sequences: geometric mean of the ratios, sequence by sequence; its interval "
                f"is that over the sequences and needs {MIN_PAIRS} of them."
            )
    else:
        rules.append("Nothing is bold, for there is no baseline to compare with.")
    return rules


def _bold_rule(label: str) -> str:
    return (
        f"Bold: better than {label}, the {100 * CONFIDENCE:g} % bootstrap interval of the paired "
        f"difference excluding zero, and best of its sequence or not separable from the best in "
        f"the same way; {label} itself is never bold, less than {MIN_PAIRS} pairs of runs make "
        f"nothing bold, a failed run counts with the limit of {FAIL_PERCENT:g} % of the path in "
        f"a difference and a pair of two failed runs not at all; no correction is made for the "
        f"number of comparisons."
    )


def _tooltip(cell: Cell) -> list[str]:
    lines = []
    stats = cell.stats
    if stats is not None:
        lines.append(f"n = {stats.n}, failed {stats.failures}")
        if stats.median is not None:
            lines.append(f"median {metres(stats.median)} m")
        if stats.low is not None and stats.high is not None and stats.mean is not None:
            spread = f"{metres(stats.low)} to {metres(stats.high)} m"
            lines.append(f"good runs: {spread}, mean {metres(stats.mean)} m")
        if stats.coverage is not None:
            lines.append(f"coverage of each at least {100 * stats.coverage:.1f} %")
        if stats.failed_ate is not None:
            lines.append(f"ATE of failed runs {metres(stats.failed_ate)} m")
        lines += [f"{count} failed: {reason}" for reason, count in stats.reasons]
    if cell.difference is not None:
        lines += _difference_lines(cell.difference, "pairs" if stats else "sequences")
    if cell.paper:
        lines.append(f"paper: {cell.paper}")
    return lines


def _difference_lines(difference: Difference, unit: str) -> list[str]:
    text = difference.text()
    if difference.low is None:
        text += f" (no interval from {difference.pairs} {unit})"
    lines = [f"to the baseline: {text}, {difference.pairs} {unit}"]
    if difference.limited:
        lines.append(f"{unit} with a failed run, at the limit: {difference.limited}")
    if difference.dropped:
        lines.append(f"{unit} dropped: {difference.dropped}")
    return lines


def cell_text(cell: Cell) -> str:
    """Ours, and after a stroke the paper's."""
    return f"{cell.text} / {cell.paper}" if cell.paper else cell.text


def to_rich(table: Table) -> RichTable:
    """The table for a terminal."""
    from rich.markup import escape
    from rich.table import Table as RichTable

    shown = RichTable(title=table.title, title_justify="left")
    shown.add_column(table.corner, no_wrap=True)
    for column in table.columns:
        shown.add_column(escape(column.title), justify="right")
    former = None
    for row in table.rows:
        if former is not None and row.group != former:
            shown.add_section()
        former = row.group
        texts = []
        for column in table.columns:
            cell = table.cell(row, column)
            style = "bold" if cell.bold else "red" if cell.failed else ""
            text = escape(cell_text(cell))
            texts.append(f"[{style}]{text}[/{style}]" if style else text)
        shown.add_row(escape(row.title), *texts)
    return shown


def to_text(results: Results, width: int = 120) -> str:
    """All tables as plain text with their rules below; bold as `*`."""
    from rich.console import Console

    console = Console(width=width, color_system=None, force_terminal=False)
    parts, said = [], None
    for table in build(results):
        cells = {
            key: replace(cell, text=f"*{cell.text}", bold=False) if cell.bold else cell
            for key, cell in table.cells.items()
        }
        with console.capture() as capture:
            console.print(to_rich(replace(table, cells=cells)))
        new = table.rules if table.rules != said else []
        said = table.rules
        rules = (textwrap.fill(rule.replace("Bold:", "*:"), width) for rule in new)
        parts.append("\n".join([capture.get().rstrip("\n"), *rules]) + "\n")
    return "\n".join(parts)
