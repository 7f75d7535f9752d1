# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The commands compare, compare-collect and launch."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from d2lio.cli.common import (
    EXIT_FAILED,
    complain,
    emit_json,
    guard,
    note,
    stderr,
    stdout,
    tail,
)
from d2lio.compare.shared.names import DEFAULT

if TYPE_CHECKING:
    from d2lio.ablate.results import Results
    from d2lio.compare.collect import Meta
    from d2lio.compare.material import Material
    from d2lio.datasets.source import Source

SEQ_HELP = "Sequence directory, bag, or the name of a scene to simulate."
VARIANTS_HELP = (
    "With commas: off, none, fixed, kiss, point_adaptive, d2; HOST:NAME for another host."
)

UPSTREAM_HELP = "upstream:fast_lio, upstream:lio_sam: those of the ROS workspace."

Seq = Annotated[str, typer.Argument(metavar="SEQ", help=SEQ_HELP)]
Host = Annotated[str, typer.Option(help="Of names without a host: fastlio, liosam, d2lio.")]
Truth = Annotated[Path | None, typer.Option(help="Ground truth, TUM: T_world_imu.")]
Config = Annotated[
    Path | None, typer.Option(help="Of a bag: extrinsic, topics; see `d2lio run --help`.")
]
Duration = Annotated[float | None, typer.Option(min=1.0, help="Of a scene to simulate, s.")]
Threads = Annotated[int, typer.Option(min=1, help="Threads of each estimator.")]


def compare(
    seq: Seq,
    variants: Annotated[str, typer.Option(help=VARIANTS_HELP)] = DEFAULT,
    host: Host = "fastlio",
    out: Annotated[
        Path | None, typer.Option(help="Directory for everything; default results/compare_SEQ.")
    ] = None,
    truth: Truth = None,
    config: Config = None,
    duration: Duration = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Variants at once; default: processor cores.")
    ] = None,
    threads: Threads = 1,
    fresh: Annotated[bool, typer.Option("--fresh", help="Run again what is done already.")] = False,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Place of the recording; no viewer.")
    ] = None,
    no_viewer: Annotated[
        bool, typer.Option("--no-viewer", help="Write the recording, do not open it.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable result.")] = False,
) -> None:
    """Run variants on one sequence and show them side by side in the rerun viewer.

    Each variant has its own process; one that crashes is a FAIL row and the others go on. Writes
    the tables and the report of `d2lio ablate`, and a recording, OUT/compare.rrd. Exit code 4: no
    variant gave a trajectory.
    """
    from d2lio.ablate.progress import Display
    from d2lio.compare.material import find_material
    from d2lio.compare.offline import CompareOptions
    from d2lio.compare.offline import compare as run
    from d2lio.compare.recording import RECORDING_FILE
    from d2lio.compare.variants import parse

    with guard():
        chosen = parse(variants, host)
        target = (out or Path("results") / f"compare_{Path(seq).stem}").absolute()
        material = find_material(seq, target, config=config, truth=truth, duration=duration)
        options = CompareOptions(jobs=jobs or os.cpu_count() or 1, threads=threads, fresh=fresh)
        with Display(stderr()) as display:
            ablation = run(material, chosen, target, options, display)
        for label, reason in ablation.problems.items():
            complain(f"{label}: {reason}")
        recording = _record(material, ablation.results, save or target / RECORDING_FILE)
        _finish(ablation.results, recording, as_json)
        if recording is not None and save is None and not (no_viewer or as_json):
            _show(recording)
        if not any(row.scans_processed for row in ablation.results.rows):
            raise typer.Exit(EXIT_FAILED)


def collect(
    out: Annotated[Path, typer.Argument(help="Output directory of compare.launch.")],
) -> None:
    """Write results, report and recording out of what the nodes of compare.launch saved."""
    from d2lio.compare import collect as work
    from d2lio.compare import recording

    with guard():
        target = out.absolute()
        results = work.collect(target)
        file = None
        if recording.missing() is None:
            source = _source_of(work.read_meta(target))
            file = recording.write(results, source, target / recording.RECORDING_FILE)
        _finish(results, file, as_json=False)
        if not any(row.scans_processed for row in results.rows):
            complain("no variant gave a trajectory")
            raise typer.Exit(EXIT_FAILED)


def launch(
    seq: Seq,
    variants: Annotated[str, typer.Option(help=f"{VARIANTS_HELP} {UPSTREAM_HELP}")] = DEFAULT,
    host: Host = "fastlio",
    out: Annotated[
        Path | None, typer.Option(help="Directory for everything; default results/launch_SEQ.")
    ] = None,
    truth: Truth = None,
    config: Config = None,
    duration: Duration = None,
    rate: Annotated[float, typer.Option(min=0.01, help="Times as fast as recorded.")] = 1.0,
    threads: Threads = 1,
    headless: Annotated[
        bool, typer.Option("--headless", help="No RViz; ends with the bag.")
    ] = False,
) -> None:
    """Run the variants as ROS nodes on a bag, with RViz and a running scoreboard.

    Writes the same results and report as `d2lio compare`. Needs ROS 1 in the environment;
    `./d2lio launch` sets it up. Exit code 4: no variant gave a trajectory.
    """
    from d2lio.compare.launch import LaunchOptions
    from d2lio.compare.launch import launch as run
    from d2lio.compare.material import find_material
    from d2lio.compare.variants import parse

    with guard():
        parse(variants, host, upstream=True)
        target = (out or Path("results") / f"launch_{Path(seq).stem}").absolute()
        material = find_material(seq, target, config=config, truth=truth, duration=duration)
        options = LaunchOptions(variants, host, rate, threads, headless)
        code = run(material, target, options)
        if code:
            raise typer.Exit(code)


def _source_of(meta: Meta) -> Source | None:
    """The bag that was played; None, with a note, where it cannot be read here."""
    from d2lio.datasets import open_source
    from d2lio.errors import ConfigError, DataError
    from d2lio.sequence import FILE_NAME

    if not meta.bag:
        return None
    config = Path(meta.config) if meta.config else None
    try:
        if config is not None and config.name == FILE_NAME:
            return open_source(config.parent)
        return open_source(Path(meta.bag), config)
    except (ConfigError, DataError) as err:
        note(f"no clouds in the recording: {err}")
        return None


def _record(material: Material, results: Results, file: Path) -> Path | None:
    """The recording; None where rerun is not installed."""
    from d2lio.ablate.cell import TRUTH_FILE
    from d2lio.compare import recording
    from d2lio.datasets import open_source
    from d2lio.report.cloud import map_file, save_map

    if (why := recording.missing()) is not None:
        note(why)
        return None
    place = map_file(results.out, material.sequence.name)
    truths = (results.out / row.directory / TRUTH_FILE for row in results.rows)
    known = next((each for each in truths if each.is_file()), None)
    if material.sequence.simulate is None and known is not None and not place.exists():
        save_map(open_source(material.origin.path, material.config), known, place)
    source = None
    if material.origin.path.exists():  # a simulation that failed leaves none
        source = open_source(material.origin.path, material.config)
    return recording.write(results, source, file.absolute())


def _show(recording: Path) -> None:
    from d2lio.compare.recording import open_viewer

    if not open_viewer(recording):
        note(f"no display; look at it elsewhere with: rerun {tail(recording)}")


def _finish(results: Results, recording: Path | None, as_json: bool) -> None:
    from d2lio.ablate.results import RESULTS_FILE
    from d2lio.compare.shared.board import plain
    from d2lio.compare.tracks import Replay, read_tracks
    from d2lio.report.ablation import write

    for text in results.notes:
        note(text)
    report = write(results, results.out)
    if as_json:
        data = {
            "out": str(results.out),
            "report": str(report),
            "recording": None if recording is None else str(recording),
            "notes": results.notes,
            "rows": [dataclasses.asdict(row) for row in results.rows],
        }
        emit_json(json.dumps(data, indent=2))
        return
    typer.echo(plain(Replay(*read_tracks(results)).end()))
    for row in results.rows:
        if row.status != "ok":
            note(f"{row.variant_title}: {row.reason}")
    named = {"results": results.out / RESULTS_FILE, "report": report, "recording": recording}
    for what, file in named.items():
        if file is not None:
            stdout().print(f"{what + ':':10s} {tail(file)}", highlight=False, soft_wrap=True)
