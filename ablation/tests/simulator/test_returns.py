# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Which rays come back: grazing incidence, distance, material, range limits."""

from __future__ import annotations

import numpy as np
import pytest
from d2lio.simulator.lidar import SENSORS
from d2lio.simulator.mesh import MATERIAL_ID, MATERIALS
from d2lio.simulator.returns import detection_probability, measure
from d2lio.simulator.world import Hits

SENSOR = SENSORS["vlp16"]
RAYS = 20_000


def hits(distance: float, cosine: float, material: str) -> Hits:
    return Hits(
        np.full(RAYS, distance), np.full(RAYS, cosine), np.full(RAYS, MATERIAL_ID[material])
    )


def share(distance: float, cosine: float, material: str) -> float:
    index, _, _ = measure(hits(distance, cosine, material), SENSOR, 0.0, np.random.default_rng(1))
    return len(index) / RAYS


def test_grazing_rays_fade_smoothly() -> None:
    cosine = np.linspace(1e-3, 1.0, 2000)
    concrete = np.full(2000, MATERIAL_ID["concrete"])
    chance = detection_probability(np.full(2000, 15.0), cosine, concrete, SENSOR.range_10)
    assert np.all(np.diff(chance) >= 0.0)
    assert np.diff(chance).max() < 0.02  # no threshold
    assert chance[0] < 0.01
    assert chance[-1] > 0.99


def test_measured_share_follows_the_probability() -> None:
    for distance, cosine in ((30.0, 1.0), (30.0, 0.1), (80.0, 1.0), (5.0, 0.04)):
        chance = detection_probability(
            np.array([distance]), np.array([cosine]), np.array([MATERIAL_ID["plaster"]]), 50.0
        )[0]
        assert share(distance, cosine, "plaster") == pytest.approx(chance, abs=0.015)


def test_half_of_a_ten_percent_target_returns_at_the_rated_range() -> None:
    reflectivity = MATERIALS["asphalt"].reflectivity
    rated = SENSOR.range_10 * np.sqrt(reflectivity / 0.1)
    assert share(rated, 1.0, "asphalt") == pytest.approx(0.5, abs=0.02)


def test_water_swallows_nearly_every_ray() -> None:
    assert 0.0 < share(3.0, 1.0, "water") < 0.03


def test_range_limits_hold_after_noise() -> None:
    rng = np.random.default_rng(2)
    spread = Hits(rng.uniform(0.0, 120.0, RAYS), np.ones(RAYS), np.full(RAYS, MATERIAL_ID["sign"]))
    _, distance, value = measure(spread, SENSOR, 0.5, rng)
    assert distance.min() >= SENSOR.min_range
    assert distance.max() <= SENSOR.max_range
    assert 0.0 <= value.min() <= value.max() <= 255.0


def test_no_hit_means_no_point() -> None:
    index, _, _ = measure(Hits.none(100), SENSOR, 0.02, np.random.default_rng(3))
    assert len(index) == 0
