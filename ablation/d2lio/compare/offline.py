# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`d2lio compare` as a function: the variants as the cells of a suite, one process each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from d2lio import __version__
from d2lio.ablate.ablation import AblateOptions, Ablation, carry_out_plan
from d2lio.ablate.cell import CellSpec, run_directory, spec_of
from d2lio.ablate.execute import host_missing
from d2lio.ablate.plan import Group, Plan
from d2lio.ablate.schedule import Watcher
from d2lio.ablate.suite import Limits
from d2lio.ablate.suite import Variant as SuiteVariant
from d2lio.compare.material import Material
from d2lio.compare.shared.names import Variant
from d2lio.compare.variants import SUITE_NAME, suite_of
from d2lio.errors import DataError


@dataclass(frozen=True, slots=True)
class CompareOptions:
    """How variants are run.

    Attributes:
        jobs: so many at once; threads: of each estimator.
        fresh: run again what is done already.
    """

    jobs: int = 1
    threads: int = 1
    fresh: bool = False


def compare(
    material: Material,
    variants: list[Variant],
    out: Path,
    options: CompareOptions,
    watcher: Watcher,
) -> Ablation:
    """Runs what is not done yet; the tables of `d2lio ablate` come out.

    Raises:
        DataError: no variant can run here, or an unusable directory.
        KeyboardInterrupt: Ctrl-C; what is done stays done.
    """
    ablate_options = AblateOptions(
        jobs=options.jobs, threads=options.threads, keep_sequences=True, fresh=options.fresh
    )
    return carry_out_plan(
        SUITE_NAME,
        lambda: make_plan(material, variants, options.threads),
        out,
        ablate_options,
        watcher,
    )


def make_plan(material: Material, variants: list[Variant], threads: int) -> Plan:
    """One cell per variant that can run here.

    Raises:
        DataError: none can.
    """
    reasons = {host: host_missing(host) for host in {v.host for v in variants}}
    kept = [v for v in variants if reasons[v.host] is None]
    notes = [f"{v.id} left out: {reasons[v.host]}" for v in variants if reasons[v.host]]
    if not kept:
        raise DataError("no variant can run here: " + "; ".join(notes))
    if not material.scored:
        notes.append("no ground truth: paths and diagnostics only (--truth FILE gives one)")
    suite = suite_of(kept, material.sequence)
    cells = [_cell(material, suite.variant(v.id), suite.limits, threads) for v in kept]
    return Plan(suite, [Group(material.origin, cells)], notes)


def _cell(material: Material, variant: SuiteVariant, limits: Limits, threads: int) -> CellSpec:
    name = material.sequence.name
    return spec_of(
        variant,
        sequence=name,
        repeat=0,
        directory=run_directory(name, 0, variant.id),
        source=str(material.origin.path),
        origin=material.origin.facts,
        config="" if material.config is None else str(material.config.absolute()),
        truth="" if material.truth is None else str(material.truth.absolute()),
        scored=material.scored,
        limits=limits,
        threads=threads,
        version=__version__,
    )
