# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The commands `d2lio peers list`, `install` and `remove`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from d2lio.cli.common import EXIT_DATA, complain, emit_json, guard, note, stdout, tail
from d2lio.errors import ConfigError, DataError

if TYPE_CHECKING:
    from d2lio.peers import Peer

WIDTH_PIPED = 200
ALL = "all"

app = typer.Typer(
    name="peers",
    help="Estimators of others, each in its own environment: list, install, remove. "
    "Run one with `d2lio run --host NAME`.",
    no_args_is_help=True,
)
Names = Annotated[list[str], typer.Argument(metavar="NAME...", help="Names, or all.")]
Into = Annotated[
    Path | None,
    typer.Option(help="Folder of the environments; runs look in $D2LIO_PEERS.", show_default=False),
]


def _chosen(names: list[str]) -> list[Peer]:
    from d2lio.peers import PEERS

    for name in names:
        if name != ALL and name not in PEERS:
            raise ConfigError("peer", name, ", ".join([ALL, *PEERS]))
    return [peer for peer in PEERS.values() if ALL in names or peer.name in names]


@app.command("list")
def list_(
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable.")] = False,
) -> None:
    """Show the peers: version, licence, kind, whether installed, and what their pose refers to."""
    from d2lio.peers import PEERS
    from d2lio.peers.environments import installed

    with guard():
        rows = [
            {
                "name": peer.name,
                "version": f"{peer.package} {peer.version}",
                "licence": peer.licence,
                "kind": peer.kind,
                "installed": installed(peer),
                "pose": peer.pose,
                "url": peer.url,
            }
            for peer in PEERS.values()
        ]
        if as_json:
            emit_json(json.dumps(rows, indent=2))
            return
        console = stdout()
        if not console.is_terminal:
            console = Console(width=WIDTH_PIPED)
        table = Table() if console.is_terminal else Table(box=None, pad_edge=False)
        columns = ("name", "version", "licence", "kind", "installed", "pose")
        for column in columns:
            table.add_column(column, overflow="fold")
        for row in rows:
            row["installed"] = "yes" if row["installed"] else "no"
            table.add_row(*(str(row[column]) for column in columns))
        console.print(table)


@app.command()
def install(names: Names, into: Into = None) -> None:
    """Make the environments of peers; what is there already is left alone.

    One that cannot be installed does not keep the others from it.
    """
    from d2lio.peers import environments

    with guard():
        failed = 0
        for peer in _chosen(names):
            try:
                made = environments.install(peer, into)
            except DataError as err:
                complain(str(err))
                failed += 1
                continue
            place = tail((into or environments.root()) / peer.env)
            word = "installed" if made else "there already"
            stdout().print(f"{peer.name}: {word} ({place})", highlight=False)
        if into is not None:
            note(f"set D2LIO_PEERS={into} for runs to find them")
        if failed:
            raise typer.Exit(EXIT_DATA)


@app.command()
def remove(names: Names, into: Into = None) -> None:
    """Remove environments; peers that share one (those of evalio) go together."""
    from d2lio.peers import environments

    with guard():
        gone: list[str] = []
        for peer in _chosen(names):
            gone += environments.remove(peer, into)
        stdout().print(f"removed: {', '.join(gone) or 'nothing'}", highlight=False)
