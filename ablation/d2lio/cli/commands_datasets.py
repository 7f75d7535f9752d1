# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The commands `d2lio datasets list`, `check`, `config` and `truth`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import yaml
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from d2lio.cli.common import (
    EXIT_DATA,
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
    from d2lio.datasets.check import Report
    from d2lio.datasets.recognise import Match

WIDTH_PIPED = 200
COLOURS = {"ok": "green", "note": "yellow", "wrong": "red", "missing": "red"}

app = typer.Typer(
    name="datasets",
    help="Known public data sets: list them, check what was downloaded, prepare ground truth.",
    no_args_is_help=True,
)
JsonOption = Annotated[bool, typer.Option("--json", help="Machine-readable result on stdout.")]


def _console() -> Console:
    """A wide one where the output is piped, so that rows stay lines."""
    console = stdout()
    return console if console.is_terminal else Console(width=WIDTH_PIPED)


def _table(console: Console, *columns: str) -> Table:
    table = Table() if console.is_terminal else Table(box=None, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


@app.command("list")
def list_(
    name: Annotated[str | None, typer.Argument(help="Only this data set.")] = None,
    paper: Annotated[bool, typer.Option("--paper", help="Only those in the paper.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the known sequences."""
    from d2lio.datasets.catalog import datasets

    with guard():
        rows: list[dict[str, Any]] = []
        for dataset in datasets().values():
            if name not in (None, dataset.name):
                continue
            for sequence in dataset.sequences:
                if paper and not sequence.tables:
                    continue
                sensor = dataset.devices[sequence.device].sensor
                extra = sequence.model_dump(exclude={"aliases"})
                rows.append({"dataset": dataset.name, "sensor": sensor, **extra})
        if not rows:
            complain(f"no such data set: {name}; known: {', '.join(datasets())}")
            raise typer.Exit(EXIT_DATA)
        if as_json:
            emit_json(json.dumps(rows, indent=2))
        else:
            _print_sequences(rows)


def _print_sequences(rows: list[dict[str, Any]]) -> None:
    console = _console()
    columns = ("dataset", "device", "sensor", "sequence", "s", "m", "truth", "table")
    table = _table(console, *columns)
    for row in rows:
        numbers = (
            "-" if row[key] is None else f"{row[key]:g}" for key in ("duration_s", "length_m")
        )
        named = (row["dataset"], row["device"], row["sensor"], row["name"])
        table.add_row(*named, *numbers, row["truth"] or "-", row["tables"] or "-")
    console.print(table)
    console.print(
        "table: of the paper; 2? where its name leaves the device or the series open. "
        "ECMD has 81 sequences, recognised by their names.",
        highlight=False,
        soft_wrap=True,
    )


@app.command()
def check(
    directory: Annotated[Path, typer.Argument(help="Bags are looked for below it.")],
    seconds: Annotated[float, typer.Option(min=0.1, help="Read so much of each.")] = 20.0,
    full: Annotated[bool, typer.Option("--full", help="Read everything.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Say what is there, missing or wrong; exit code 4 if anything is missing or wrong."""
    from d2lio.datasets.check import check_recording
    from d2lio.datasets.recordings import find_recordings

    with guard():
        recordings = find_recordings(directory)
        if not recordings:
            complain(f"{directory}: no .bag, .mcap or metadata.yaml below it")
            raise typer.Exit(EXIT_FAILED)
        reports = []
        for recording in recordings:
            with progress_bar(recording.path.name) as update:
                reports.append(check_recording(recording, None if full else seconds, update))
        if as_json:
            emit_json(json.dumps([_as_dict(report) for report in reports], indent=2))
        else:
            _print_reports(reports)
        if any(report.verdict in ("missing", "wrong") for report in reports):
            raise typer.Exit(EXIT_FAILED)


def _named(match: Match | None) -> str:
    if match is None:
        return "unknown"
    sequence = f" {match.sequence.name}" if match.sequence else ""
    return f"{match.dataset.name}/{match.device_name}{sequence}"


def _as_dict(report: Report) -> dict[str, Any]:
    return {
        "path": str(report.recording.path),
        "files": [str(f) for f in report.recording.files],
        "recognised": _named(report.match),
        "by": report.match.by if report.match else None,
        "duration_s": report.duration_s,
        "verdict": report.verdict,
        "truth": str(report.truth_file) if report.truth_file else None,
        "streams": [
            {"topic": name, "rate_hz": rate, "messages": count}
            for name, rate, count in _streams(report)
        ],
        "findings": [{"level": f.level, "what": f.what, "text": f.text} for f in report.findings],
    }


def _streams(report: Report) -> list[tuple[str, float | None, int]]:
    """Topic, rate in Hz and number of messages in the recording."""
    if report.measured is None:
        return []
    totals = {t.name: t.count for t in report.topics}
    streams = dict(report.measured.imus)
    rows = [(name, each.rate_hz, totals.get(name, 0)) for name, each in streams.items()]
    lidar = report.measured.lidar
    if lidar is not None and lidar.topic:
        rows.insert(0, (lidar.topic, lidar.rate_hz, totals.get(lidar.topic, 0)))
    return rows


def _print_reports(reports: list[Report]) -> None:
    console = _console()
    table = _table(console, "recording", "recognised as", "s", "streams", "verdict")
    for report in reports:
        streams = "; ".join(
            f"{name} {'?' if rate is None else f'{rate:.1f}'} Hz"
            for name, rate, _ in _streams(report)
        )
        verdict = f"[{COLOURS[report.verdict]}]{report.verdict}[/]"
        cells = (tail(report.recording.path), _named(report.match), f"{report.duration_s:.1f}")
        table.add_row(*(escape(cell) for cell in (*cells, streams)), verdict)
    console.print(table)
    remarks = _table(console, "recording", "", "about", "finding")
    for report in reports:
        for found in report.findings:
            level = f"[{COLOURS[found.level]}]{found.level}[/]"
            cells = (report.recording.path.name, found.what, found.text)
            where, what, text = (escape(cell) for cell in cells)
            remarks.add_row(where, level, what, text)
    console.print(remarks)


@app.command()
def config(
    device: Annotated[str, typer.Argument(help="DATASET/DEVICE, e.g. geode/gamma.")],
) -> None:
    """Write the configuration of a device as YAML, for `d2lio run --config`."""
    from d2lio.datasets import catalog

    with guard():
        known = catalog.device(device)
        for remark in known.remarks():
            note(remark)
        data = known.source_config(device.replace("/", "_")).model_dump()
        typer.echo(yaml.safe_dump(data, sort_keys=False, default_flow_style=None), nl=False)


@app.command()
def truth(
    recording: Annotated[Path, typer.Argument(help="Bag or its directory, of a known sequence.")],
    out: Annotated[Path, typer.Option(help="TUM file to write.")],
    estimate: Annotated[
        Path | None, typer.Option(help="Trajectory to move to position-only truth.")
    ] = None,
    moved: Annotated[Path | None, typer.Option(help="Where the moved one goes.")] = None,
) -> None:
    """Write a sequence's ground truth for `d2lio evaluate`: TUM, poses of the IMU where known."""
    from d2lio.datasets.recognise import find_truth, recognise
    from d2lio.datasets.truth import at_truth_body, read_truth, write_truth
    from d2lio.errors import ConfigError, DataError
    from d2lio.metrics import tum

    with guard():
        if (estimate is None) != (moved is None):
            raise ConfigError("--estimate", str(estimate), "together with --moved")
        match = recognise(recording, {})
        if match is None or match.truth is None:
            raise DataError(f"{recording}: no known sequence with ground truth")
        file = find_truth(recording, match)
        if file is None:
            raise DataError(f"{recording}: no ground truth of {_named(match)} found around it")
        known = read_truth(file, match.truth, match.device_name)
        for remark in known.notes:
            note(remark)
        write_truth(out, known)
        if estimate is not None and moved is not None:
            tum.write(moved, at_truth_body(tum.read_tum(estimate), known))
        stdout().print(f"{tail(file)} -> {tail(out)}: {_named(match)}", highlight=False)
