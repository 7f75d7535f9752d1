# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What is claimed of method `noise_aware`, a test per claim, on sequences shorter than the suite's.

Both hosts run with their defaults; `none` is the same host without handling. Not claimed, because
it does not hold: less than 7 cm between cabinets on every seed of so short a drive (1 of 16 runs of
15 s had 19 cm). What is claimed of the covariance: test_consistency.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from built import host_params
from d2lio.bare_tunnel import EndError, end_error
from d2lio.datasets import open_source
from d2lio.metrics import read_tum
from d2lio.metrics.alignment import aligned_rmse
from d2lio.metrics.tum import interpolate
from d2lio.seeds import METHOD, REJECTION, track
from d2lio.simulator import simulate

DURATION = 12.0  # s, of which 2 s standstill
SEEDS = (0, 1)
CABINETS_ATE_M = 0.07
TIMES_LOWER = 5.0
DRIFT_SHARE = 0.02  # of the path; below it there is nothing to win
HARM = 1.05
SIGMAS = 3.0
MAX_GAP_S = 0.05

each_host = pytest.mark.parametrize("host", host_params(tuple(REJECTION)))


@dataclass(frozen=True, slots=True)
class Outcome:
    """ATE RMSE, m; the same as a share of the path; error of the last pose."""

    ate: float
    share: float
    end: EndError


Runs = Callable[[str, int, str, str], Outcome]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    """A function of scene, seed, host and method; nothing is simulated or run twice."""

    @cache
    def sequence(scene: str, seed: int) -> Path:
        place = tmp_path_factory.mktemp(f"{scene}_{seed}") / "sequence"
        simulate(scene, place, seed=seed, duration=DURATION)
        return place

    @cache
    def run(scene: str, seed: int, host: str, method: str) -> Outcome:
        source = open_source(sequence(scene, seed))
        assert source.ground_truth is not None
        truth = read_tum(source.ground_truth)
        estimate = track(source, host, REJECTION[host], method)
        poses = estimate.trajectory
        true = interpolate(truth, poses.stamps, MAX_GAP_S)
        ate = aligned_rmse(true.positions, poses.positions)
        return Outcome(ate, ate / truth.path_m, end_error(estimate, truth))

    return run


@pytest.mark.parametrize("seed", SEEDS)
@each_host
def test_tunnel_with_cabinets_is_held(host: str, seed: int, runs: Runs) -> None:
    assert runs("tunnel_cabinets", seed, host, METHOD).ate < CABINETS_ATE_M


@each_host
@pytest.mark.parametrize("scene", ["tunnel_cabinets", "corridor", "highway"])
def test_five_times_lower_where_nothing_is_handled(scene: str, host: str, runs: Runs) -> None:
    none = runs(scene, 0, host, "none")
    assert none.share > DRIFT_SHARE
    assert TIMES_LOWER * runs(scene, 0, host, METHOD).ate <= none.ate


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("scene", ["room", "dense_street"])
@each_host
def test_costs_nothing_where_all_is_seen(host: str, scene: str, seed: int, runs: Runs) -> None:
    none = runs(scene, seed, host, "none")
    assert runs(scene, seed, host, METHOD).ate <= HARM * none.ate


@pytest.mark.parametrize("seed", SEEDS)
def test_costs_nothing_off_road(seed: int, runs: Runs) -> None:
    none = runs("offroad", seed, "fastlio", "none")
    assert runs("offroad", seed, "fastlio", METHOD).ate <= HARM * none.ate


@pytest.mark.parametrize("seed", SEEDS)
@each_host
def test_sigma_along_a_bare_tunnel_covers_the_error(host: str, seed: int, runs: Runs) -> None:
    """Without handling 10 m of error stand beside a sigma of a centimetre."""
    end = runs("tunnel", seed, host, METHOD).end
    assert abs(end.along) < SIGMAS * end.sigma_along
