# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The command ablate."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d2lio.cli.common import (
    EXIT_FAILED,
    EXIT_USAGE,
    complain,
    emit_json,
    guard,
    note,
    stderr,
    stdout,
    tail,
)
from d2lio.errors import ConfigError

if TYPE_CHECKING:
    from d2lio.ablate.ablation import Ablation
    from d2lio.ablate.results import Results

WIDTH_PIPED = 160


def ablate(
    suite: Annotated[
        str | None, typer.Argument(help="Shipped suite (see --list) or a YAML file.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory for everything; default results/SUITE.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at once; default: processor cores.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Use the recordings below it, not the simulator.")
    ] = None,
    imports: Annotated[
        list[str] | None,
        typer.Option("--import", metavar="NAME=DIR", help="Trajectories of a column, TUM."),
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Instead of the suite's.")] = None,
    only_variants: Annotated[str | None, typer.Option(help="Ids, with commas.")] = None,
    only_sequences: Annotated[str | None, typer.Option(help="Names, with commas.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster: tcp://HOST:8786.")
    ] = None,
    keep_sequences: Annotated[
        bool, typer.Option("--keep-sequences", help="Leave simulated sequences on the disk.")
    ] = False,
    threads: Annotated[int, typer.Option(min=1, help="Threads of each estimator.")] = 1,
    fresh: Annotated[bool, typer.Option("--fresh", help="Run again what is done already.")] = False,
    list_suites: Annotated[bool, typer.Option("--list", help="Show the shipped suites.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable result.")] = False,
) -> None:
    """Run a suite: variants x sequences x repeats, with tables, statistics and a report.

    Every run has its own process; one that fails is a row with its reason. Stopped at any moment
    and started again, only what is missing runs. Exit code 4: some cells could not be carried out
    at all; start again.
    """
    from d2lio.ablate.ablation import AblateOptions
    from d2lio.ablate.ablation import ablate as run
    from d2lio.ablate.progress import Display
    from d2lio.ablate.suite import load_suite

    with guard():
        if list_suites:
            _list(as_json)
            return
        if suite is None:
            complain("give the name of a suite or a file; --list shows the shipped ones")
            raise typer.Exit(EXIT_USAGE)
        chosen = load_suite(suite).reduced(
            repeats=repeats, sequences=_names(only_sequences), variants=_names(only_variants)
        )
        target = (out or Path("results") / chosen.name).absolute()
        options = AblateOptions(
            jobs=jobs or os.cpu_count() or 1,
            threads=threads,
            data=data,
            imports=_imports(imports or []),
            scheduler=scheduler,
            keep_sequences=keep_sequences,
            fresh=fresh,
        )
        with Display(stderr()) as display:
            ablation = run(chosen, target, options, display)
        _finish(ablation, as_json)
        if ablation.problems:
            complain(f"{len(ablation.problems)} cells were not carried out; start again for them")
            raise typer.Exit(EXIT_FAILED)


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _imports(texts: list[str]) -> dict[str, Path]:
    found = {}
    for text in texts:
        name, separator, folder = text.partition("=")
        if not separator or not name or not folder:
            raise ConfigError("--import", text, "NAME=DIR")
        found[name] = Path(folder)
    return found


def _list(as_json: bool) -> None:
    from d2lio.ablate.suite import Suite, shipped

    suites = {name: Suite.load(file) for name, file in shipped().items()}
    if as_json:
        emit_json(json.dumps({n: s.model_dump(by_alias=True) for n, s in suites.items()}, indent=2))
        return
    for name, suite in suites.items():
        cells = sum(len(suite.variants_of(s)) for s in suite.sequences)
        size = f"{cells} cells x {suite.repeats} repeats"
        said = suite.description or suite.title
        stdout().print(f"{name:12s} {size}: {said}", highlight=False, soft_wrap=True, markup=False)


def _finish(ablation: Ablation, as_json: bool) -> None:
    from d2lio.ablate.results import RESULTS_FILE
    from d2lio.report.ablation import write

    results = ablation.results
    for text in results.notes:
        note(text)
    report = write(results, results.out)
    if as_json:
        _emit(ablation, report)
        return
    _print_tables(results)
    stdout().print(f"results: {tail(results.out / RESULTS_FILE)}", highlight=False, soft_wrap=True)
    stdout().print(f"report:  {tail(report)}", highlight=False, soft_wrap=True)


def _print_tables(results: Results) -> None:
    from d2lio.ablate.tables import to_text

    console = stdout()
    width = console.width if console.is_terminal else WIDTH_PIPED
    typer.echo(to_text(results, width))


def _emit(ablation: Ablation, report: Path) -> None:
    results = ablation.results
    rows = [dataclasses.asdict(row) for row in results.rows]
    data: dict[str, Any] = {
        "suite": results.suite.name,
        "out": str(results.out),
        "report": str(report),
        "notes": results.notes,
        "problems": ablation.problems,
        "rows": rows,
    }
    emit_json(json.dumps(data, indent=2))
