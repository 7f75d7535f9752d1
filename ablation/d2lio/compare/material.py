# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What is compared on: a sequence directory, a recording, or a scene to simulate."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from d2lio.ablate.sequences import Origin, recorded, simulated
from d2lio.ablate.suite import Simulate, SuiteSequence
from d2lio.datasets import open_source
from d2lio.datasets.recognise import find_truth, recognise
from d2lio.errors import DataError


@dataclass(frozen=True, slots=True)
class Material:
    """A sequence and what is known of it.

    Attributes:
        sequence: as a suite names it.
        origin: where it lies, or how it is made.
        config: configuration of a recording, None for none; truth: TUM file given beside it.
        scored: whether there is a truth.
    """

    sequence: SuiteSequence
    origin: Origin
    config: Path | None
    truth: Path | None
    scored: bool


def is_scene(name: str) -> bool:
    """Whether that is a scene of the simulator and nothing on the disk."""
    from d2lio.simulator import SCENES

    return name in SCENES and not Path(name).exists()


def find_material(
    name: str,
    out: Path,
    *,
    config: Path | None = None,
    truth: Path | None = None,
    duration: float | None = None,
) -> Material:
    """Finds out what `name` is.

    Args:
        out: a simulated sequence goes below it.
        duration: of a simulated sequence, s; None is the scene's own.

    Raises:
        DataError: neither readable nor a scene, or `truth` is missing; ConfigError: `config`.
    """
    if truth is not None and not truth.is_file():
        raise DataError(f"{truth}: no such file")
    if is_scene(name):
        sequence = SuiteSequence(name=name, simulate=Simulate(scene=name, duration=duration))
        return Material(sequence, simulated(out, sequence, 0), None, truth, True)
    path = Path(name)
    if not path.exists():
        from d2lio.simulator import SCENES

        raise DataError(f"{name}: no such file or directory, nor a scene ({', '.join(SCENES)})")
    source = open_source(path, config)
    scored = truth is not None or source.ground_truth is not None or _has_known_truth(path)
    origin = recorded(path, 0, 0.0)
    facts = origin.facts | _facts(config, truth) | {"scored": scored}
    sequence = SuiteSequence(name=source.name, recording=[source.name])
    return Material(sequence, Origin(origin.path, facts), config, truth, scored)


def _has_known_truth(path: Path) -> bool:
    match = recognise(path, {})
    return match is not None and match.truth is not None and find_truth(path, match) is not None


def _facts(config: Path | None, truth: Path | None) -> dict[str, Any]:
    """What tells the contents of files apart that are given beside the recording."""
    files = {"config": config, "truth": truth}
    return {k: _digest(f) for k, f in files.items() if f is not None}


def _digest(file: Path) -> str:
    """SHA-256 of a file; of its path where that names a known device instead."""
    content = file.read_bytes() if file.is_file() else file.as_posix().encode()
    return hashlib.sha256(content).hexdigest()
