# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The virtual environments of the peers: where they lie, how they are made and removed.

An environment counts as made once its manifest is there, which is written last. The manifest holds
the pins, so that other pins make an environment stale.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from d2lio.errors import DataError
from d2lio.peers.catalog import PEERS, Peer

MANIFEST = "d2lio-peer.json"
ERROR_LINES = 5


def root() -> Path:
    """$D2LIO_PEERS, or peers in the user's data directory."""
    given = os.environ.get("D2LIO_PEERS")
    if given:
        return Path(given)
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "d2lio" / "peers"


def override_variable(peer: Peer) -> str:
    """The variable that names another interpreter for a peer."""
    return "D2LIO_PEER_PYTHON_" + peer.name.upper().replace("-", "_")


def interpreter(peer: Peer) -> Path:
    """The Python that has the peer.

    Raises:
        DataError: it is not installed; the message has the command that installs it.
    """
    given = os.environ.get(override_variable(peer))
    if given:
        return Path(given)
    if not installed(peer):
        raise DataError(f"{peer.name} is not installed; run: d2lio peers install {peer.name}")
    return _python(root() / peer.env)


def installed(peer: Peer, into: Path | None = None) -> bool:
    """Whether its environment is whole and has the pinned version."""
    place = (into or root()) / peer.env
    try:
        manifest = json.loads((place / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return manifest.get("pins") == peer.pins and _python(place).exists()


def _python(place: Path) -> Path:
    return place / "bin" / "python"


@contextmanager
def _locked(folder: Path, env: str) -> Iterator[None]:
    """One at a time makes or removes an environment."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / f".{env}.lock").open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield
    except PermissionError as err:
        raise DataError(f"{folder}: cannot be written: {err.strerror}") from None


def install(peer: Peer, into: Path | None = None) -> bool:
    """Makes the environment of a peer; False where it was there.

    Raises:
        DataError: pip could not install it; nothing half-made counts as installed.
    """
    folder = into or root()
    with _locked(folder, peer.env):
        if installed(peer, folder):
            return False
        place = folder / peer.env
        shutil.rmtree(place, ignore_errors=True)
        try:
            _make(peer, place)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
    return True


def _make(peer: Peer, place: Path) -> None:
    _run([sys.executable, "-m", "venv", str(place)], peer, {})
    pip = [str(_python(place)), "-m", "pip"]
    with tempfile.TemporaryDirectory() as scratch:
        constraints = Path(scratch) / "build.txt"
        constraints.write_text("".join(f"{line}\n" for line in peer.build_constraints))
        # Old pips read the first for what they build with, new ones the second.
        variables = ("PIP_CONSTRAINT", "PIP_BUILD_CONSTRAINT") if peer.build_constraints else ()
        extra = dict.fromkeys(variables, str(constraints))
        package, *rest = peer.pins
        if peer.alone:
            _run([*pip, "install", "--quiet", "--no-deps", package], peer, extra)
        together = rest if peer.alone else peer.pins
        _run([*pip, "install", "--quiet", *together], peer, extra)
    frozen = _run([*pip, "freeze"], peer, {}).splitlines()
    manifest = {"pins": peer.pins, "packages": sorted(frozen)}
    partial = place / f".{MANIFEST}"
    partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    os.replace(partial, place / MANIFEST)


def _run(command: list[str], peer: Peer, extra: dict[str, str]) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    try:
        done = subprocess.run(
            command,
            env=environment | extra,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
        )
    except OSError as err:
        raise DataError(f"{peer.name}: {command[0]}: {err.strerror}") from None
    if done.returncode != 0:
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        said = " / ".join(lines[-ERROR_LINES:])
        raise DataError(f"{peer.name} could not be installed: {said}")
    return done.stdout


def remove(peer: Peer, into: Path | None = None) -> list[str]:
    """Removes the environment of a peer; the names of all peers that lose it."""
    folder = into or root()
    place = folder / peer.env
    if not place.exists():
        return []
    with _locked(folder, peer.env):
        (place / MANIFEST).unlink(missing_ok=True)  # first: half removed is not whole
        shutil.rmtree(place)
    return [other.name for other in PEERS.values() if other.env == peer.env]
