# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The commands run, evaluate, simulate and params."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from d2lio.cli.common import (
    EXIT_FAILED,
    EXIT_USAGE,
    complain,
    emit_json,
    guard,
    note,
    progress_bar,
    stdout,
    tail,
)

if TYPE_CHECKING:
    from d2lio.metrics import Evaluation
    from d2lio.record import RunRecord

DEFAULT_HOST = "fastlio"
HostOption = Annotated[str, typer.Option(help="fastlio, liosam, d2lio, or one of `peers list`.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Machine-readable result on stdout.")]
ThreadsOption = Annotated[int, typer.Option(min=1, help="Threads of the estimator.")]


def run(
    sequence: Annotated[
        Path, typer.Argument(help="Sequence directory, bag (ROS 1, ROS 2, MCAP), KITTI, Ouster.")
    ],
    config: Annotated[
        Path | None, typer.Option(help="YAML for a bag: topics, extrinsic, times.")
    ] = None,
    host: HostOption = DEFAULT_HOST,
    rejection: Annotated[
        str | None,
        typer.Option(help="off, none, fixed, kiss or point_adaptive; unset is the host's own."),
    ] = None,
    degeneracy: Annotated[
        str | None,
        typer.Option(
            help="none, paper, remap, tsvd, xicp or noise_aware; unset is the host's own."
        ),
    ] = None,
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Host parameter.")
    ] = None,
    threads: ThreadsOption = 1,
    out: Annotated[Path | None, typer.Option(help="Directory for the results.")] = None,
    max_scans: Annotated[int | None, typer.Option(min=1, help="Stop after so many.")] = None,
    start_offset: Annotated[
        float, typer.Option(min=0.0, help="Leave out so much at the start, s.")
    ] = 0.0,
    stamps: Annotated[
        str | None, typer.Option(help="header, or log: times of reception (clocks differ).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run an estimator over recorded data: trajectory.tum, diagnostics.csv, run.json."""
    from d2lio import runner
    from d2lio.datasets import open_source
    from d2lio.source_params import parse_assignments

    with guard():
        source = open_source(sequence, config, stamps)
        options = runner.RunOptions(
            host=host,
            rejection=rejection,
            degeneracy=degeneracy,
            params=parse_assignments(assignments or []),
            threads=threads,
            max_scans=max_scans,
            start_offset_s=start_offset,
            command=sys.argv[1:],
        )
        name = "_".join(filter(None, (source.name, host, rejection, degeneracy)))
        target = out or Path("results") / name
        with progress_bar(source.name) as update:
            record = runner.run(source, options, target, update)
        _report_run(record, target, as_json)
        if record.status != "complete":
            complain(f"{record.status}: {record.reason}")
            raise typer.Exit(EXIT_FAILED)


def _plain_table() -> Table:
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column()
    table.add_column(overflow="fold")
    return table


def _report_run(record: RunRecord, target: Path, as_json: bool) -> None:
    if as_json:
        emit_json(record)
        return
    for message in record.notes:
        note(message)
    table = _plain_table()
    total = record.time_ms.get("total")
    rows = {
        "scans": f"{record.scans.processed} of {record.scans.read}",
        "dropped": ", ".join(f"{n} {why}" for why, n in record.scans.dropped.items()) or "none",
        "health": ", ".join(f"{n} {name}" for name, n in record.health.items()),
        "accepted": "-"
        if record.accepted_share is None
        else f"{100 * record.accepted_share:.1f} %",
        "path": f"{record.path_m:.1f} m in {record.duration_s:.1f} s",
        "time per scan": "-"
        if total is None
        else f"{total.mean:.1f} ms mean, {total.median:.1f} median, {total.p95:.1f} p95, "
        f"{total.max:.1f} max (reading {1e3 * record.read_s / max(record.scans.read, 1):.1f})",
        "wall, memory": f"{record.wall_s:.1f} s, {record.peak_memory_mb:.0f} MB",
        "results": tail(target),
    }
    for key, value in rows.items():
        table.add_row(f"[dim]{key}[/]", value)
    stdout().print(table)


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory, TUM (or the directory of a run).")],
    truth: Annotated[Path, typer.Argument(help="Ground truth, TUM.")],
    align: Annotated[str, typer.Option(help="se3, first or none.")] = "se3",
    t_max_diff: Annotated[float, typer.Option(help="Largest time between paired poses, s.")] = 0.01,
    rpe_delta: Annotated[float, typer.Option(help="Distance of RPE pairs.")] = 10.0,
    rpe_unit: Annotated[str, typer.Option(help="m or f (frames).")] = "m",
    interpolate: Annotated[
        bool, typer.Option(help="Bring both to common times before pairing.")
    ] = True,
    min_coverage: Annotated[float, typer.Option(min=0.0, max=1.0, help="Less fails.")] = 0.95,
    out: Annotated[Path | None, typer.Option(help="Directory for the matched files.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Figure: .png, .svg or .pdf.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Score a trajectory: evo's APE and RPE, coverage, first-pose and end error."""
    from d2lio import metrics
    from d2lio.record import TRAJECTORY_FILE

    with guard():
        if estimate.is_dir():
            estimate = estimate / TRAJECTORY_FILE
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
        options = metrics.EvaluateOptions(
            align=align,  # type: ignore[arg-type]  # checked by EvaluateOptions.check
            t_max_diff=t_max_diff,
            rpe_delta=rpe_delta,
            rpe_unit=rpe_unit,  # type: ignore[arg-type]
            interpolate=interpolate,
            min_coverage=min_coverage,
            out=out,
        )
        result, curves = metrics.evaluate(estimate, truth, options)
        if plot is not None and curves is not None:
            from d2lio.metrics.plot import plot_curves

            plot_curves(curves, result, plot)
        if as_json:
            emit_json(result)
        else:
            _report_evaluation(result)
        if result.status != "ok":
            complain(result.reason)
            raise typer.Exit(EXIT_FAILED)


def _report_evaluation(result: Evaluation) -> None:
    table = _plain_table()

    def row(name: str, value: float | None, unit: str) -> None:
        table.add_row(f"[dim]{name}[/]", "-" if value is None else f"{value:.4f} {unit}")

    table.add_row("[dim]coverage[/]", f"{100 * result.coverage:.1f} %, {result.pairs} pairs")
    row(f"ATE RMSE ({result.align})", result.ate.rmse if result.ate else None, "m")
    row("ATE / path", result.ate_percent, "%")
    delta = f"{result.rpe_delta:g} {result.rpe_unit}"
    row(f"RPE {delta}", result.rpe_trans.rmse if result.rpe_trans else None, "m")
    row(f"RPE {delta}", result.rpe_rot.rmse if result.rpe_rot else None, "deg")
    row("ATE, first pose aligned", result.first_pose_ate, "m")
    row("end error", result.end_error_m, "m")
    row("largest time difference", result.max_time_diff_s, "s")
    for name, path in result.files.items():
        table.add_row(f"[dim]{name}[/]", path)
    stdout().print(table)


def simulate(
    scene: Annotated[str, typer.Argument(help="Scene; `list` shows all with the sensors.")],
    sensor: Annotated[str, typer.Option(help="LiDAR model.")] = "vlp16",
    imu: Annotated[str, typer.Option(help="IMU grade.")] = "industrial",
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 0,
    duration: Annotated[float | None, typer.Option(help="s; default of the scene.")] = None,
    orientation: Annotated[
        bool, typer.Option("--orientation", help="A 9-axis IMU: messages with an attitude.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Sequence directory to make.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Make a simulated sequence: data.bag, gt.tum, sequence.yaml."""
    from d2lio import simulator

    with guard():
        if scene == "list":
            _list_registries(as_json)
            return
        name = f"{scene}_{sensor}_s{seed}"
        target = out or Path("sequences") / name
        with progress_bar(name) as update:
            made = simulator.simulate(
                scene,
                target,
                sensor=sensor,
                seed=seed,
                duration=duration,
                imu=imu,
                orientation=orientation,
                progress=update,
            )
        if as_json:
            emit_json(json.dumps({"sequence": made.name, "path": str(target)}))
        else:
            stdout().print(f"{made.name}: {tail(target)}", highlight=False)


def _list_registries(as_json: bool) -> None:
    from d2lio import simulator

    registries = {
        "scenes": simulator.SCENES,
        "sensors": simulator.SENSORS,
        "imu": simulator.IMU_GRADES,
    }
    if as_json:
        names = {k: {n: d.description for n, d in v.items()} for k, v in registries.items()}
        emit_json(json.dumps(names, indent=2))
        return
    for title, registry in registries.items():
        table = Table(title=title, show_header=False, box=None, title_justify="left")
        for name, entry in registry.items():
            table.add_row(name, entry.description)
        stdout().print(table)


def params(
    host: Annotated[
        str, typer.Option(help="fastlio, liosam, d2lio, or all of them.")
    ] = DEFAULT_HOST,
    markdown: Annotated[bool, typer.Option("--markdown", help="A page for the manual.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show every parameter: key, type, default, range, unit, meaning."""
    from d2lio.hosts import HOSTS, describe
    from d2lio.params import to_markdown

    with guard():
        entries = {name: describe(name) for name in (HOSTS if host == "all" else [host])}
        if markdown and as_json:
            complain("--markdown and --json exclude each other")
            raise typer.Exit(EXIT_USAGE)
        if as_json:
            emit_json(json.dumps(entries if host == "all" else entries[host], indent=2))
        elif markdown:
            sys.stdout.write(to_markdown(entries))
        else:
            for name in entries:
                _print_params(name, entries[name])


def _print_params(host: str, entries: list[dict[str, str]]) -> None:
    table = Table(title=f"host {host}")
    for column in ("key", "type", "default", "range", "unit", "doc"):
        table.add_column(column, overflow="fold", no_wrap=column == "key")
    for entry in entries:
        table.add_row(*(entry[c] for c in ("key", "type", "default", "range", "unit", "doc")))
    stdout().print(table)
