# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""From a suite to the cells that can run here."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

from d2lio import __version__
from d2lio.ablate.cell import CellSpec, run_directory, spec_of
from d2lio.ablate.execute import host_missing
from d2lio.ablate.sequences import Origin, find_recorded, recorded, simulated
from d2lio.ablate.suite import Suite, SuiteSequence, Variant
from d2lio.errors import ConfigError, DataError
from d2lio.peers import PEERS

TUM_SUFFIXES = (".tum", ".txt")


@dataclass(slots=True)
class Group:
    """The cells of one repeat of a sequence."""

    origin: Origin
    cells: list[CellSpec] = field(default_factory=list)


@dataclass(slots=True)
class Plan:
    """What is going to be done.

    Attributes:
        suite: as it runs: without the variants and sequences that cannot run here.
        groups: in the order of the suite: by sequence, then repeat.
        notes: what was left out, and why.
    """

    suite: Suite
    groups: list[Group]
    notes: list[str]

    @property
    def cells(self) -> list[CellSpec]:
        """All cells in the order of the results."""
        return [cell for group in self.groups for cell in group.cells]


def make_plan(
    suite: Suite,
    out: Path,
    *,
    data: Path | None = None,
    imports: dict[str, Path] | None = None,
    threads: int = 1,
) -> Plan:
    """Finds out what of a suite can run here.

    Args:
        suite: reduced to what is wanted.
        out: directory of the ablation.
        data: recordings below it take the place of simulated sequences.
        imports: directories of TUM files by the name that the variants import.

    Raises:
        ConfigError: an import that no variant wants, or nothing left to run; DataError: `data` or
            an imported directory is not there.
    """
    notes: list[str] = []
    imports = imports or {}
    variants = _runnable(suite, imports, notes)
    paths = _recordings(suite, data, notes)
    kept = [s.name for s in suite.sequences if (s.name in paths if data else s.simulate)]
    if data is None:
        missing = [s.name for s in suite.sequences if s.simulate is None]
        notes += [f"{name}: a recording; needs --data" for name in missing]
    if not kept or not variants:
        what = "sequence" if not kept else "variant"
        raise ConfigError("suite", suite.name, f"one with a {what} that can run here; " + notes[-1])
    suite = suite.reduced(sequences=kept, variants=variants)
    groups = []
    for sequence in suite.sequences:
        for repeat in range(suite.repeats):
            origin = _origin(suite, sequence, repeat, out, paths)
            groups.append(Group(origin, _cells(suite, sequence, repeat, origin, imports, threads)))
    for variant in suite.variants:
        if variant.import_ and not any(c.variant == variant.id for g in groups for c in g.cells):
            notes.append(
                f"{variant.id}: no trajectory of any sequence in {imports[variant.import_]}"
            )
    return Plan(suite, groups, notes)


def _runnable(suite: Suite, imports: dict[str, Path], notes: list[str]) -> list[str]:
    wanted = [variant.import_ for variant in suite.variants if variant.import_]
    for name, folder in imports.items():
        if name not in wanted:
            raise ConfigError("--import", name, ", ".join(wanted) or "none in this suite")
        if not folder.is_dir():
            raise DataError(f"{folder}: no such directory")
    kept, reasons = [], {}
    for variant in suite.variants:
        why = _missing(variant, imports)
        if why is None:
            kept.append(variant.id)
        else:
            reasons.setdefault(why, []).append(variant.id)
    notes += [f"{', '.join(ids)} left out: {why}" for why, ids in reasons.items()]
    return kept


def _missing(variant: Variant, imports: dict[str, Path]) -> str | None:
    """Why a variant cannot run here; None where it can."""
    if variant.import_ is not None:
        absent = variant.import_ not in imports
        return f"no --import {variant.import_}=DIR" if absent else None
    return host_missing(variant.host or "")


def _recordings(suite: Suite, data: Path | None, notes: list[str]) -> dict[str, Path]:
    """Recordings by the suite's name of their sequence."""
    if data is None:
        return {}
    found = find_recorded(data, [name for s in suite.sequences for name in s.recording])
    paths = {}
    for sequence in suite.sequences:
        there = [name for name in sequence.recording if name in found]
        if there:
            paths[sequence.name] = found[there[0]]
        elif sequence.recording:
            names = " or ".join(sequence.recording)
            notes.append(f"{sequence.name} left out: no recording {names} below {data}")
        else:
            notes.append(f"{sequence.name} left out: simulated only")
    return paths


def _origin(
    suite: Suite, sequence: SuiteSequence, repeat: int, out: Path, paths: dict[str, Path]
) -> Origin:
    if sequence.name in paths:
        return recorded(paths[sequence.name], repeat, suite.offset_step_s)
    return simulated(out, sequence, repeat)


def _cells(
    suite: Suite,
    sequence: SuiteSequence,
    repeat: int,
    origin: Origin,
    imports: dict[str, Path],
    threads: int,
) -> list[CellSpec]:
    cells = []
    for variant in suite.variants_of(sequence):
        imported = None
        if variant.import_ is not None:
            imported = _import_file(imports[variant.import_], sequence.name, repeat)
            if imported is None:
                continue
        cells.append(
            spec_of(
                variant,
                sequence=sequence.name,
                repeat=repeat,
                directory=run_directory(sequence.name, repeat, variant.id),
                source=str(origin.path),
                origin=origin.facts,
                start_offset_s=origin.start_offset_s,
                imported=None if imported is None else str(imported.absolute()),
                imported_hash="" if imported is None else _hash(imported),
                limits=suite.limits,
                threads=threads,
                version=__version__,
                peer_version=PEERS[variant.host].version if variant.host in PEERS else "",
            )
        )
    return cells


def _import_file(folder: Path, sequence: str, repeat: int) -> Path | None:
    """SEQUENCE_rK.tum, SEQUENCE/rK.tum, or for the first repeat SEQUENCE.tum; .txt as well."""
    names = [f"{sequence}_r{repeat}", f"{sequence}/r{repeat}"]
    if repeat == 0:
        names.append(sequence)
    files = (folder / f"{name}{suffix}" for name in names for suffix in TUM_SUFFIXES)
    return next((file for file in files if file.is_file()), None)


def _hash(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as err:
        raise DataError(f"{file}: cannot be read: {err.strerror}") from None
