# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The `d2lio` command."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from d2lio import __version__
from d2lio.cli import (
    commands_ablate,
    commands_compare,
    commands_datasets,
    commands_demo,
    commands_peers,
    commands_run,
)
from d2lio.cli.common import EXIT_BUG, EXIT_CODES, EXIT_INTERRUPTED, crash_report

app = typer.Typer(
    name="d2lio",
    help=f"Degeneracy-aware LiDAR-inertial odometry: simulate, run, evaluate.\n\n{EXIT_CODES}",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(commands_run.run)
app.command("evaluate")(commands_run.evaluate)
app.command("simulate")(commands_run.simulate)
app.command("params")(commands_run.params)
app.command("demo")(commands_demo.demo)
app.command("ablate")(commands_ablate.ablate)
app.command("compare")(commands_compare.compare)
app.command("compare-collect", hidden=True)(commands_compare.collect)
launch = typer.Typer(name="launch", help="Comparisons out of ROS nodes.", no_args_is_help=True)
launch.callback()(lambda: None)  # a command of its own even while there is but one
launch.command("compare")(commands_compare.launch)
app.add_typer(launch)
app.add_typer(commands_datasets.app)
app.add_typer(commands_peers.app)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"d2lio {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point; see EXIT_CODES."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    except Exception as err:
        crash_report(err)
        sys.exit(EXIT_BUG)


__all__ = ["app", "main"]
