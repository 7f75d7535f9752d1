# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Where the sequences of a suite come from: simulation, or recordings below a directory."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from d2lio.ablate.suite import Simulate, SuiteSequence, slug

SEQUENCES = "sequences"


@dataclass(frozen=True, slots=True)
class Origin:
    """A sequence of one repeat.

    Attributes:
        path: sequence directory or recording.
        facts: what a result depends on, plain data.
        simulation: arguments of `simulator.simulate` that make it; None for a recording.
        start_offset_s: of a recording.
    """

    path: Path
    facts: dict[str, Any]
    simulation: dict[str, Any] | None = None
    start_offset_s: float = 0.0


def simulated(out: Path, sequence: SuiteSequence, repeat: int) -> Origin:
    """Repeat `repeat` of a simulated sequence; its directory's name tells all parameters apart."""
    assert sequence.simulate is not None
    arguments = _arguments(sequence.simulate, repeat)
    digest = hashlib.sha256(json.dumps(arguments, sort_keys=True).encode()).hexdigest()
    name = f"{slug(sequence.name)}_s{arguments['seed']}_{digest[:8]}"
    facts = {"kind": "simulated", **arguments}
    return Origin(out / SEQUENCES / name, facts, arguments)


def _arguments(simulate: Simulate, repeat: int) -> dict[str, Any]:
    return {
        "scene": simulate.scene,
        "sensor": simulate.sensor,
        "imu": simulate.imu,
        "seed": simulate.seed_base + repeat,
        "duration": simulate.duration,
        "orientation": simulate.orientation,
    }


def recorded(path: Path, repeat: int, offset_step_s: float) -> Origin:
    """Repeat `repeat` of a recording."""
    files = [path] if path.is_file() else sorted(f for f in path.rglob("*") if f.is_file())
    facts = {"kind": "recorded", "files": [[f.name, f.stat().st_size] for f in files]}
    return Origin(path.absolute(), facts, None, repeat * offset_step_s)


def find_recorded(data: Path, names: list[str]) -> dict[str, Path]:
    """Recordings below `data` by the name of the known sequence, of those that are wanted.

    Raises:
        DataError: no such directory.
    """
    from d2lio.datasets.recognise import recognise
    from d2lio.datasets.recordings import find_recordings

    wanted = {name.lower(): name for name in names}
    found: dict[str, Path] = {}
    for recording in find_recordings(data):
        match = recognise(recording.path, {})
        if match is None or match.sequence is None:
            continue
        known = match.sequence
        for alias in (known.name, *known.aliases):
            if alias.lower() in wanted:
                found.setdefault(wanted[alias.lower()], recording.path)
    return found
