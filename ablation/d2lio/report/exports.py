# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tables of an ablation as Markdown, LaTeX and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path

from d2lio.ablate.tables import Cell, Header, Table
from d2lio.output import replace_file

TABLES_DIR = "tables"
CSV_COLUMNS = (
    "row_group", "row", "column", "text", "bold", "paper", "n", "failures", "median_m", "mean_m",
    "min_m", "max_m", "coverage_min", "difference_percent", "difference_low_percent",
    "difference_high_percent", "pairs", "pairs_dropped", "pairs_with_failure",
)  # fmt: skip
_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "²": r"\textsuperscript{2}", "<": r"\textless{}", ">": r"\textgreater{}", "λ": r"$\lambda$",
    "ε": r"$\varepsilon$", "[": "{[}", "]": "{]}",
}  # fmt: skip


def to_markdown(table: Table) -> str:
    """A table of GitHub's Markdown with its rules below."""
    head = [table.corner, *(column.title for column in table.columns)]
    lines = [f"**{_md(table.title)}**", "", _md_line(map(_md, head))]
    lines.append(_md_line(["---", *("---:" for _ in table.columns)]))
    for group, rows in groupby(table.rows, key=lambda row: row.group):
        if group:
            lines.append(_md_line([f"*{_md(group)}*", *("" for _ in table.columns)]))
        for row in rows:
            cells = (_md_cell(table.cell(row, column)) for column in table.columns)
            lines.append(_md_line([_md(row.title), *cells]))
    return "\n".join([*lines, "", *(f"{_md(rule)}  " for rule in table.rules)]) + "\n"


def _md_line(texts: Iterable[str]) -> str:
    return f"| {' | '.join(texts)} |"


def _md(text: str) -> str:
    return re.sub(r"([\\|*_<`\[\]])", r"\\\1", text)


def _md_cell(cell: Cell) -> str:
    ours = f"**{_md(cell.text)}**" if cell.bold else _md(cell.text)
    return f"{ours} / {cell.paper}" if cell.paper else ours


def to_latex(table: Table) -> str:
    r"""A `table` environment; needs `booktabs`, and `inputenc` or an engine that reads UTF-8.

    Bold as in the caption's rule, the lowest median of each sequence underlined.
    """
    width = 1 + len(table.columns)
    title, rules = _tex(table.title), " ".join(map(_tex, table.rules))
    head = " & ".join([_tex(table.corner), *(_tex(column.title) for column in table.columns)])
    lines = [
        r"\begin{table}",
        r"\centering",
        r"\footnotesize",
        rf"\caption[{title}]{{{title}. {rules}}}",
        rf"\begin{{tabular}}{{l{'r' * len(table.columns)}}}",
        r"\toprule",
        rf"{head} \\",
    ]
    for group, rows in groupby(table.rows, key=lambda row: row.group):
        lines.append(r"\midrule")
        if group:
            lines.append(rf"\multicolumn{{{width}}}{{l}}{{\emph{{{_tex(group)}}}}} \\")
        lines += [_tex_row(table, row) for row in rows]
    lines += [r"\bottomrule", r"\end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def _tex_row(table: Table, row: Header) -> str:
    texts = [_tex(row.title)]
    for column in table.columns:
        cell = table.cell(row, column)
        text = _tex(cell.text)
        text = rf"\underline{{{text}}}" if cell.best else text
        text = rf"\textbf{{{text}}}" if cell.bold else text
        texts.append(f"{text} / {_tex(cell.paper)}" if cell.paper else text)
    return rf"{' & '.join(texts)} \\"


def _tex(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in text)


def to_csv(table: Table) -> str:
    """One line per cell with all that lies behind it."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, CSV_COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in table.rows:
        for column in table.columns:
            cell = table.cell(row, column)
            if cell.text:
                writer.writerow(_csv_row(row, column, cell))
    return text.getvalue()


def _csv_row(row: Header, column: Header, cell: Cell) -> dict[str, object]:
    values: dict[str, object] = {
        "row_group": row.group,
        "row": row.title,
        "column": column.title,
        "text": cell.text,
        "bold": int(cell.bold),
        "paper": cell.paper,
    }
    stats, difference = cell.stats, cell.difference
    if stats is not None:
        values |= {
            "n": stats.n, "failures": stats.failures, "median_m": stats.median,
            "mean_m": stats.mean, "min_m": stats.low, "max_m": stats.high,
            "coverage_min": stats.coverage,
        }  # fmt: skip
    if difference is not None:
        values |= {
            "difference_percent": difference.percent,
            "difference_low_percent": difference.low_percent,
            "difference_high_percent": difference.high_percent,
            "pairs": difference.pairs,
            "pairs_dropped": difference.dropped,
            "pairs_with_failure": difference.limited,
        }
    return values


FORMATS: dict[str, Callable[[Table], str]] = {
    ".md": to_markdown,
    ".tex": to_latex,
    ".csv": to_csv,
}


def file_stems(name: str, tables: list[Table]) -> list[str]:
    """Names of the tables' files, without ending."""
    if len(tables) == 1:
        return [name]
    return [f"{name}_{index}" for index, _ in enumerate(tables, start=1)]


def write_tables(name: str, tables: list[Table], out: Path) -> list[Path]:
    """Writes every table in every format into OUT/tables; the files written."""
    folder = out / TABLES_DIR
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for stem, table in zip(file_stems(name, tables), tables, strict=True):
        for suffix, export in FORMATS.items():
            file = folder / f"{stem}{suffix}"
            replace_file(file, export(table))
            written.append(file)
    return written
