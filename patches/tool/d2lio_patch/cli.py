# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Command line of ``./d2lio patch``."""

from __future__ import annotations

import argparse
import errno
import sys

from d2lio_patch import report
from d2lio_patch.errors import E_DISK, E_INTERRUPTED, E_IO, PatchError
from d2lio_patch.guard import only_one, refuse_dirty
from d2lio_patch.hooks import PATCHES, HookSet, load_set
from d2lio_patch.hosts import Host, recognise
from d2lio_patch.plan import Plan, digest, plan_patch, plan_revert
from d2lio_patch.transaction import Transaction

_EPILOG = """\
Only lines are inserted, between d2lio:begin and d2lio:end; nothing of yours is changed or removed.
All files are changed together or not at all, also when the call is killed or the disk fills: the
next call completes or undoes what was left.

exit codes: 0 done (or nothing to do), 2 usage, 13 disk full, 20 not a checkout that is known,
21 an anchor is absent or there twice, 22 a file has changes of yours or is read-only,
23 another call is at work or left something that it cannot clear up, 24 other file errors,
130 interrupted
"""


def parse(argv: list[str]) -> argparse.Namespace:
    """Reads the arguments; ends the program (code 2) where they are wrong."""
    parser = argparse.ArgumentParser(
        prog="d2lio patch",
        description="Insert the D2-LIO hooks into a FAST_LIO or LIO-SAM checkout (ROS 1 or ROS 2).",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("checkout", metavar="CHECKOUT", help="folder with the package.xml")
    show = parser.add_mutually_exclusive_group()
    show.add_argument("--check", action="store_true", help="list what would be done; touch nothing")
    show.add_argument("--diff", action="store_true", help="print a unified diff; touch nothing")
    parser.add_argument("--revert", action="store_true", help="take everything out again")
    parser.add_argument("--force", action="store_true", help="also with changed or read-only files")
    parser.add_argument(
        "--compat",
        action="store_true",
        help="also what the host needs to compile on Debian 12 (LIO-SAM); stays until --revert",
    )
    arguments = parser.parse_args(argv)
    if arguments.revert and arguments.compat:
        parser.error("--revert takes out everything; it goes without --compat")
    return arguments


def main(argv: list[str]) -> int:
    """Runs the command; returns the exit code."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")
    arguments = parse(argv)
    try:
        _run(arguments)
    except PatchError as refusal:
        print(f"d2lio patch: {refusal}", file=sys.stderr)
        return refusal.code
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        what = "the disk is full" if full else str(error)
        print(f"d2lio patch: {what}; no file was touched", file=sys.stderr)
        return E_DISK if full else E_IO
    except KeyboardInterrupt:
        print("d2lio patch: interrupted", file=sys.stderr)
        return E_INTERRUPTED
    return 0


def _run(arguments: argparse.Namespace) -> None:
    host = recognise(arguments.checkout)
    transaction = Transaction(host.root)
    if arguments.check or arguments.diff:
        if transaction.pending():
            print(
                "d2lio patch: an earlier call was interrupted; the next one that writes clears up",
                file=sys.stderr,
            )
        _show(host, transaction, arguments)
        return
    with only_one(host.root):
        try:
            recovered = transaction.recover(arguments.force)
        except OSError as error:
            message = (
                f"an earlier call was interrupted, and clearing up failed: {error}; call again"
            )
            raise PatchError(E_IO, message) from error
        if recovered:
            print(recovered)
        _apply(host, transaction, arguments)


def _show(host: Host, transaction: Transaction, arguments: argparse.Namespace) -> None:
    state = transaction.state()
    plan = _plan(host, state, arguments)
    if arguments.diff:
        sys.stdout.buffer.write(report.diff(list(plan.files)))
        sys.stdout.buffer.flush()
        return
    changing = [file for file in plan.files if file.changes]
    print(f"{host.title}, package {host.package}, in {host.root}")
    if not arguments.revert:
        print(report.listing(plan))
    print("to do:\n" + report.summary(changing) if changing else "nothing to do")
    if not arguments.force:
        refuse_dirty(host.root, changing, state)


def _apply(host: Host, transaction: Transaction, arguments: argparse.Namespace) -> None:
    state = transaction.state()
    plan = _plan(host, state, arguments)
    changing = [file for file in plan.files if file.changes]
    wanted = None if arguments.revert else _state(host, plan)
    if not changing and (state is None) == (wanted is None):
        print(f"{host.title}: " + ("not patched" if arguments.revert else "already patched"))
        return
    if not arguments.force:
        refuse_dirty(host.root, changing, state)
    transaction.run(changing, wanted)
    print(f"{host.title}: " + ("as it was before" if arguments.revert else "patched"))
    print(report.summary(changing))
    if arguments.revert:
        print("rebuild the package")
    else:
        print(report.next_steps(host), end="")


def _sets(host: Host, state: dict | None, compat: bool) -> list[HookSet]:
    """The sets that the checkout shall have; compat stays once it is there."""
    hooks, fixes = load_set(host.kind.key), load_set(host.kind.key, "compat")
    if fixes and not any(host.flavour in hook.flavours for hook in fixes.hooks):
        fixes = None
    if compat and fixes is None:
        print(f"{host.title} needs no compile fix: --compat does nothing", file=sys.stderr)
    with_fixes = compat or (state is not None and "compat" in state["sets"])
    return [s for s in (hooks, fixes if with_fixes else None) if s is not None]


def _plan(host: Host, state: dict | None, arguments: argparse.Namespace) -> Plan:
    if not arguments.revert:
        sets = _sets(host, state, arguments.compat)
        return plan_patch(host, sets, str(PATCHES.parent))
    sets = [s for name in ("hooks", "compat") if (s := load_set(host.kind.key, name))]
    known = list(state["files"]) if state else []
    known += [path for s in sets for hook in s.hooks for path in hook.files]
    return plan_revert(host, list(dict.fromkeys(known)))


def _state(host: Host, plan: Plan) -> dict:
    return {
        "version": 1,
        "host": host.kind.key,
        "flavour": host.flavour,
        "sets": list(dict.fromkeys(i.hook.set_name for i in plan.insertions)),
        "files": {
            file.path: {"original": digest(file.original), "patched": digest(file.wanted)}
            for file in plan.files
        },
    }
