# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Repeats of a cell, and paired differences between variants with bootstrap intervals.

Differences are logarithms of ratios of ATEs of the same sequence and repeat: what two variants have
in common (the noise of the seed, the length of the path) drops out, and a half is as far from
equality as a double.

Intervals: the plain percentile bootstrap of a mean of five values covers about 85 % where it says
95 %, and BCa does not do better, because five values show too little of their own spread. The
percentiles are therefore widened as in Hesterberg, "What Teachers Should Know About the Bootstrap"
(The American Statistician 69, 2015), section 3.2, which gives 90 to 95 % of coverage; less than
five pairs give no interval.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from d2lio.ablate.results import ResultRow
from d2lio.metrics import FAIL_PERCENT

CONFIDENCE = 0.95
MIN_PAIRS = 5  # the range of fewer values holds their median less often than the confidence says
RESAMPLES = 20_000
SEED = 0
TINY_M = 1e-9  # an ATE of zero has no logarithm


@dataclass(frozen=True, slots=True)
class CellStats:
    """The repeats of one variant on one sequence; ATEs in m, None where there are none.

    Attributes:
        n, failures: runs, and how many of them failed.
        median: over all runs, a failed one counting as worse than every other; None where that
            leaves no number. A median of the good runs alone would reward failing.
        mean, low, high: of the good runs.
        coverage: smallest of all runs, [0, 1].
        failed_ate: median ATE of the failed runs that have one.
        reasons: of the failures, with their number, most frequent first.
    """

    n: int
    failures: int
    median: float | None
    mean: float | None
    low: float | None
    high: float | None
    coverage: float | None
    failed_ate: float | None
    reasons: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Difference:
    """Mean logarithm of the ratio of two variants' ATEs, with its interval.

    Attributes:
        log_ratio: below zero where the first variant is the better one.
        low, high: bounds of the interval; None for less than MIN_PAIRS pairs.
        pairs: that were averaged; dropped: those where both failed or one is missing.
        limited: pairs in which one run failed and counts with the limit, FAIL_PERCENT of the path.
    """

    log_ratio: float
    low: float | None
    high: float | None
    pairs: int
    dropped: int = 0
    limited: int = 0

    @property
    def better(self) -> bool:
        """Whether the interval excludes zero on the good side."""
        return self.high is not None and self.high < 0.0

    @property
    def worse(self) -> bool:
        """Whether the interval excludes zero on the bad side."""
        return self.low is not None and self.low > 0.0

    @property
    def percent(self) -> float:
        """The difference in percent."""
        return as_percent(self.log_ratio)

    @property
    def low_percent(self) -> float | None:
        """The lower bound in percent."""
        return None if self.low is None else as_percent(self.low)

    @property
    def high_percent(self) -> float | None:
        """The upper bound in percent."""
        return None if self.high is None else as_percent(self.high)

    def text(self) -> str:
        """Percent with the interval: `-12 % [-20, -3]`."""
        shown = f"{self.percent:+.0f} %"
        if self.low_percent is None or self.high_percent is None:
            return shown
        return f"{shown} [{self.low_percent:+.0f}, {self.high_percent:+.0f}]"


def as_percent(log_ratio: float) -> float:
    """Logarithm of a ratio as a difference in percent."""
    return 100.0 * math.expm1(log_ratio)


def summarise(rows: Sequence[ResultRow]) -> CellStats:
    """Figures of the repeats of one cell."""
    good = [row.ate_m for row in rows if row.status == "ok" and row.ate_m is not None]
    bad = [row for row in rows if row.status != "ok" or row.ate_m is None]
    ranked = sorted(good) + [math.inf] * len(bad)
    median = float(np.median(ranked)) if ranked else math.inf
    failed = [row.ate_m for row in bad if row.ate_m is not None and math.isfinite(row.ate_m)]
    covered = [row.coverage for row in rows if row.coverage is not None]
    return CellStats(
        n=len(rows),
        failures=len(bad),
        median=median if math.isfinite(median) else None,
        mean=float(np.mean(good)) if good else None,
        low=min(good, default=None),
        high=max(good, default=None),
        coverage=min(covered, default=None),
        failed_ate=float(np.median(failed)) if failed else None,
        reasons=tuple(Counter(row.reason or "failed" for row in bad).most_common()),
    )


def by_repeat(rows: Iterable[ResultRow]) -> dict[int, ResultRow]:
    """The repeats of one cell."""
    return {row.repeat: row for row in rows}


def compare(
    rows: Sequence[ResultRow], reference: Sequence[ResultRow], confidence: float = CONFIDENCE
) -> Difference | None:
    """The paired difference of a variant to a reference on one sequence; None without pairs.

    Where one run of a pair failed, it counts with the limit, FAIL_PERCENT of the path; a pair of
    two failures says nothing and is dropped.
    """
    ratios, limited, dropped = paired_log_ratios(rows, reference)
    if not ratios:
        return None
    low, high = mean_interval(ratios, confidence)
    return Difference(float(np.mean(ratios)), low, high, len(ratios), dropped, limited)


def paired_log_ratios(
    rows: Sequence[ResultRow], reference: Sequence[ResultRow]
) -> tuple[list[float], int, int]:
    """Log ratios by repeat; how many of them hold a failed run; how many pairs were dropped."""
    ours, theirs = by_repeat(rows), by_repeat(reference)
    ratios, limited, dropped = [], 0, 0
    for repeat in sorted(ours.keys() | theirs.keys()):
        pair = ours.get(repeat), theirs.get(repeat)
        scored = _scores(*pair) if pair[0] is not None and pair[1] is not None else None
        if scored is None:
            dropped += 1
            continue
        ratios.append(math.log(scored[0] / scored[1]))
        limited += any(row is not None and row.status != "ok" for row in pair)
    return ratios, limited, dropped


def _scores(a: ResultRow, b: ResultRow) -> tuple[float, float] | None:
    if a.status != "ok" and b.status != "ok":
        return None
    path = a.path_m or b.path_m
    values = []
    for row in (a, b):
        if row.status == "ok" and row.ate_m is not None:
            values.append(max(row.ate_m, TINY_M))
        elif path:
            values.append(path * FAIL_PERCENT / 100.0)
        else:
            return None
    return values[0], values[1]


def mean_interval(
    values: Sequence[float], confidence: float = CONFIDENCE
) -> tuple[float | None, float | None]:
    """Expanded percentile bootstrap interval of the mean; (None, None) for too few values.

    Args:
        values: independent ones.
        confidence: of the two-sided interval, in (0, 1).
    """
    n = len(values)
    if n < MIN_PAIRS:
        return None, None
    sample = np.asarray(values, np.float64)
    rng = np.random.default_rng(SEED)
    means = sample[rng.integers(0, n, (RESAMPLES, n))].mean(axis=1)
    # The bootstrap's spread is too small by sqrt((n - 1) / n), and the normal's tails are thinner
    # than Student's.
    reach = math.sqrt(n / (n - 1)) * stats.t.isf((1.0 - confidence) / 2.0, n - 1)
    tail = float(stats.norm.sf(reach))
    low, high = np.quantile(means, [tail, 1.0 - tail])
    return float(low), float(high)


def pooled(by_sequence: Mapping[str, Difference | None]) -> Difference | None:
    """One difference from those of several sequences; None where there is none.

    The mean over sequences of each one's mean, so the geometric mean of the ratios; the bootstrap
    draws sequences, so the interval is about other sequences of that kind, not about other seeds.
    """
    found = [d for d in by_sequence.values() if d is not None]
    if not found:
        return None
    means = [d.log_ratio for d in found]
    low, high = mean_interval(means)
    return Difference(
        log_ratio=float(np.mean(means)),
        low=low,
        high=high,
        pairs=len(means),
        dropped=len(by_sequence) - len(found),
        limited=sum(d.limited > 0 for d in found),
    )
