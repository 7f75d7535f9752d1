# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Variants of a comparison as those of a suite."""

from __future__ import annotations

from d2lio.ablate.suite import Layout, Suite, SuiteSequence
from d2lio.ablate.suite import Variant as SuiteVariant
from d2lio.compare.shared import names
from d2lio.compare.shared.names import Variant, VariantError
from d2lio.errors import ConfigError
from d2lio.report.ablation import COMPARISON

SUITE_NAME = COMPARISON
LIMIT_S = 6 * 3600.0
LIMIT_MB = 8000.0


def parse(text: str, host: str = "fastlio", *, upstream: bool = False) -> list[Variant]:
    """See `shared.names.parse`.

    Raises:
        ConfigError: an unknown name or host, one given twice, or none at all.
    """
    try:
        return names.parse(text, host, upstream)
    except VariantError as err:
        key, _, rest = str(err).partition(": ")
        value, _, allowed = rest.partition("; ")
        raise ConfigError(f"--{key}", value, allowed.removeprefix("allowed: ") or "each") from None


def suite_of(variants: list[Variant], sequence: SuiteSequence) -> Suite:
    """The suite of one repeat of one sequence, one column per variant, in their order.

    An upstream node's trajectory is an imported one to it.
    """
    chosen = [
        SuiteVariant(
            id=v.id,
            title=v.title,
            host=v.host or None,
            rejection=v.rejection or None,
            degeneracy=v.degeneracy or None,
            import_=v.upstream or None,
        )
        for v in variants
    ]
    return Suite(
        name=SUITE_NAME,
        title=f"Variants on {sequence.name}",
        description="Variants side by side.",
        repeats=1,
        limits={"time_s": LIMIT_S, "memory_mb": LIMIT_MB},
        layout=Layout(rows="variant", columns="sequence"),
        sequences=[sequence],
        variants=chosen,
    )
