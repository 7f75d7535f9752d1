# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the commands share: consoles, progress, errors and exit codes.

Standard output carries results only (JSON with `--json`); messages and progress bars go to
standard error, the bars only where that is a terminal.
"""

from __future__ import annotations

import errno
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from d2lio.errors import ConfigError, DataError

EXIT_BUG = 1
EXIT_USAGE = 2  # typer's own code for bad options; also a refused configuration
EXIT_DATA = 3
EXIT_FAILED = 4
EXIT_INTERRUPTED = 130

EXIT_CODES = (
    "Exit codes: 0 done, 1 internal error, 2 bad usage or configuration, 3 unreadable input or "
    "unwritable output, 4 the run or evaluation failed, 130 interrupted."
)


def stdout() -> Console:
    """Console for results."""
    return Console()


def stderr() -> Console:
    """Console for messages and progress."""
    return Console(stderr=True)


def complain(message: str) -> None:
    """One line for the user."""
    stderr().print(f"[bold red]error:[/] {escape(message)}", soft_wrap=True, highlight=False)


def note(message: str) -> None:
    """A remark that changes nothing."""
    stderr().print(f"[yellow]note:[/] {escape(message)}", soft_wrap=True, highlight=False)


def emit_json(model: BaseModel | str) -> None:
    """Writes JSON and nothing else to standard output."""
    text = model if isinstance(model, str) else model.model_dump_json(indent=2)
    sys.stdout.write(text + "\n")


@contextmanager
def guard() -> Iterator[None]:
    """Turns the errors a user can cause into one line and an exit code."""
    try:
        yield
    except (typer.Exit, typer.Abort):
        raise
    except KeyboardInterrupt as err:
        complain(str(err) or "interrupted")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    except DataError as err:
        complain(str(err))
        raise typer.Exit(EXIT_DATA) from None
    except OSError as err:
        full = err.errno in (errno.ENOSPC, errno.EDQUOT)
        complain("the disk is full; nothing was left half-written" if full else str(err))
        raise typer.Exit(EXIT_DATA) from None
    except ConfigError as err:
        complain(str(err))
        raise typer.Exit(EXIT_USAGE) from None


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[..., None]]:
    """A bar on standard error, nothing where that is not a terminal.

    Yields:
        A function of (done, total or None, new title or None).
    """
    console = stderr()
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(escape(title), total=None)

        def update(done: float, total: float | None, what: str | None = None) -> None:
            bar.update(task, completed=done, total=total, description=escape(what or title))

        yield update


def crash_report(error: BaseException) -> None:
    """An internal error: the trace, so that it can be reported."""
    complain(f"internal error: {type(error).__name__}: {error}")
    traceback.print_exception(error)


def tail(path: Path) -> str:
    """A path as short as it can be said from here."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
