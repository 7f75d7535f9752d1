# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Repeats, paired differences and their intervals, against values made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from d2lio.ablate import statistics
from d2lio.ablate.statistics import compare, mean_interval, paired_log_ratios, pooled, summarise
from fake_results import PATH_M, row
from scipy import stats

LIMIT_M = 0.05 * PATH_M
SEED = 4


def cell(variant: str, *ates: float | None, sequence: str = "a") -> list:
    return [row(sequence, repeat, variant, ate) for repeat, ate in enumerate(ates)]


def test_the_median_is_over_all_runs() -> None:
    stats = summarise(cell("v", 0.3, 0.1, 0.2, 0.5, 0.4))
    assert (stats.n, stats.failures, stats.median) == (5, 0, 0.3)
    assert (stats.low, stats.high, stats.coverage) == (0.1, 0.5, 1.0)
    assert stats.mean == pytest.approx(0.3)
    assert stats.reasons == ()


@pytest.mark.parametrize(
    ("ates", "median"),
    [
        ((0.1, 0.2, 0.3, 0.4, None), 0.3),
        ((0.1, 0.2, 0.3, None, 9.0), 0.3),
        ((0.1, 0.2, None, None, 9.0), None),
        ((0.1, None), None),
        ((0.1,), 0.1),
        ((None,), None),
    ],
)
def test_a_failed_run_is_worse_than_every_other(
    ates: tuple[float | None, ...], median: float | None
) -> None:
    assert summarise(cell("v", *ates)).median == median


def test_failures_are_counted_with_their_reasons() -> None:
    stats = summarise(cell("v", None, 0.1, None, 12.0, 20.0))
    assert stats.failures == 4
    assert stats.failed_ate == 16.0
    assert dict(stats.reasons) == {"crashed (SIGSEGV)": 2, "ATE 20.0 % of the path": 2}
    assert stats.mean == stats.low == stats.high == 0.1


def test_differences_are_paired_by_repeat() -> None:
    base = cell("b", 1.0, 2.0, 0.5, 0.25, 1.0)
    ours = list(reversed(cell("v", 0.5, 1.0, 0.25, 0.125, 0.5)))  # in any order
    difference = compare(ours, base)
    assert difference is not None
    assert difference.percent == pytest.approx(-50.0)
    assert difference.low == pytest.approx(difference.log_ratio)  # every pair says the same
    assert difference.better
    assert not difference.worse
    assert difference.text() == "-50 % [-50, -50]"


def test_the_mean_of_log_ratios_by_hand() -> None:
    base, ours = cell("b", 1.0, 1.0, 1.0), cell("v", 2.0, 0.5, 2.0)
    difference = compare(ours, base)
    assert difference is not None
    assert difference.log_ratio == pytest.approx(math.log(2.0) / 3.0)
    assert (difference.low, difference.high) == (None, None)  # three pairs are too few
    assert not difference.better
    assert not difference.worse
    assert difference.text() == "+26 %"


def test_one_failed_run_counts_with_the_limit_and_two_drop_the_pair() -> None:
    base, ours = cell("b", 1.0, None, 1.0, None), cell("v", None, 1.0, 1.0, None)
    ratios, limited, dropped = paired_log_ratios(ours, base)
    assert ratios == pytest.approx([math.log(LIMIT_M), -math.log(LIMIT_M), 0.0])
    assert (limited, dropped) == (2, 1)


def test_a_missing_repeat_drops_the_pair() -> None:
    ratios, limited, dropped = paired_log_ratios(cell("v", 1.0), cell("b", 1.0, 1.0))
    assert (len(ratios), limited, dropped) == (1, 0, 1)
    assert compare(cell("v", None), cell("b", None)) is None


def test_a_failure_without_a_path_drops_the_pair() -> None:
    lost = [row("a", 0, "v", None, path_m=None)]
    ratios, _, dropped = paired_log_ratios(lost, [row("a", 0, "b", 1.0, path_m=None)])
    assert (ratios, dropped) == ([], 1)


def test_a_perfect_run_has_a_logarithm() -> None:
    difference = compare(cell("v", 0.0), cell("b", 1.0))
    assert difference is not None
    assert math.isfinite(difference.log_ratio)


def test_equal_values_and_order_of_bounds() -> None:
    assert mean_interval([0.0] * 5) == (0.0, 0.0)
    values = np.random.default_rng(SEED).normal(1.0, 1.0, 12)
    low, high = mean_interval(values)
    assert low is not None
    assert high is not None
    assert values.min() < low < values.mean() < high < values.max()
    assert mean_interval(values) == (low, high)  # the same draw every time
    narrower = mean_interval(values, 0.5)
    assert low < narrower[0] < narrower[1] < high


def test_the_interval_is_the_percentile_one_at_a_widened_level() -> None:
    values = np.random.default_rng(SEED).exponential(1.0, 20)
    n = len(values)
    level = 2.0 * stats.norm.cdf(math.sqrt(n / (n - 1)) * stats.t.ppf(0.975, n - 1)) - 1.0
    theirs = stats.bootstrap(
        (values,), np.mean, confidence_level=level, n_resamples=20_000, method="percentile"
    ).confidence_interval
    resampling = 0.05 * (theirs.high - theirs.low)
    assert mean_interval(values) == pytest.approx(tuple(theirs), abs=resampling)


@pytest.mark.parametrize(("n", "least", "most"), [(5, 0.90, 0.95), (16, 0.93, 0.96)])
def test_the_interval_covers_the_mean_as_often_as_stated(
    n: int, least: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    trials, resamples = 600, 4000
    monkeypatch.setattr(statistics, "RESAMPLES", resamples)
    rng = np.random.default_rng(SEED)
    covered = plain = 0
    for values in rng.normal(0.3, 0.2, (trials, n)):
        low, high = mean_interval(values)
        covered += low <= 0.3 <= high
        means = values[rng.integers(0, n, (resamples, n))].mean(axis=1)
        bounds = np.quantile(means, [0.025, 0.975])
        plain += bounds[0] <= 0.3 <= bounds[1]
    band = stats.binom(trials, least).ppf(0.001), stats.binom(trials, most).ppf(0.999)
    assert band[0] <= covered <= band[1], covered / trials
    assert plain < covered


def test_pooling_takes_sequences_as_they_are() -> None:
    halves = {f"s{i}": compare(cell("v", *[0.5] * 5), cell("b", *[1.0] * 5)) for i in range(4)}
    doubles = {"d": compare(cell("v", *[2.0] * 50), cell("b", *[1.0] * 50))}  # weighs no more
    difference = pooled(halves | doubles | {"none": None})
    assert difference is not None
    assert difference.log_ratio == pytest.approx(-3.0 / 5.0 * math.log(2.0))
    assert (difference.pairs, difference.dropped) == (5, 1)
    assert difference.low is not None
    assert difference.low < difference.log_ratio < difference.high
    assert not difference.better  # one sequence of five is against it
    assert pooled({"none": None}) is None
