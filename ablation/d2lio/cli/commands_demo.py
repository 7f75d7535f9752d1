# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The command demo."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.table import Table

from d2lio.cli.common import (
    EXIT_FAILED,
    complain,
    emit_json,
    guard,
    note,
    progress_bar,
    stdout,
    tail,
)

if TYPE_CHECKING:
    from d2lio.demo import DemoResult


def demo(
    out: Annotated[Path, typer.Option(help="Directory for sequences, runs and report.")] = Path(
        "results/demo"
    ),
    threads: Annotated[int, typer.Option(min=1, help="Threads of the estimator.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable result.")] = False,
) -> None:
    """Rerun the ablation in small: three scenes, three hosts, rejection modes, prior off and on."""
    from d2lio.demo import run_demo

    with guard():
        with progress_bar("demo") as update:
            result = run_demo(
                out,
                threads=threads,
                progress=lambda what, done, total: update(done, total, what),
            )
        if as_json:
            _emit(result)
        else:
            _print(result)
        if result.crashed:
            complain(f"{len(result.crashed)} of {len(result.rows)} runs did not finish")
            raise typer.Exit(EXIT_FAILED)


def _emit(result: DemoResult) -> None:
    from d2lio.demo import REPORT_FILE, RESULTS_FILE, csv_row

    emit_json(
        json.dumps(
            {
                "note": result.note,
                "rows": [csv_row(row, result.out) for row in result.rows],
                "results": str(result.out / RESULTS_FILE),
                "report": str(result.out / REPORT_FILE),
            },
            indent=2,
        )
    )


def _print(result: DemoResult) -> None:
    from d2lio.demo import REPORT_FILE, RESULTS_FILE, cells
    from d2lio.metrics import FAIL_PERCENT

    table = Table(
        title="ATE \\[m], accepted correspondences, median ms per scan",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column("variant", no_wrap=True)
    for scene in result.scenes:
        table.add_column(scene.title, justify="right", no_wrap=True)
    former = ""
    for variant in result.variants:
        if variant.group != former:
            table.add_row(f"[dim]{variant.group}[/]")
            former = variant.group
        texts = [f"{ate} {share:>4} {ms:>4}" for ate, share, ms in cells(result, variant)]
        table.add_row(f" {variant.rejection}", *texts)
    stdout().print(table)
    if result.note:
        note(f"left out: {result.note}")
    failed = [row for row in result.rows if row.status != "ok"]
    for row in failed:
        if row.ate is not None:
            continue  # the table says it
        note(f"{row.scene.name}, {row.variant.label}: {row.reason}")
    if failed:
        note(f"`-`: coverage below 95 % or ATE beyond {FAIL_PERCENT:g} % of the path")
    stdout().print(f"table:  {tail(result.out / RESULTS_FILE)}", highlight=False)
    stdout().print(f"report: {tail(result.out / REPORT_FILE)}", highlight=False)
