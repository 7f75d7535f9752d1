# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The `kiss` strategy against the kiss-icp package's own adaptive threshold."""

from __future__ import annotations

import numpy as np
import pytest
from d2lio import _core
from kiss_icp import threshold as kiss_threshold
from kiss_icp.config import KISSConfig
from scipy.spatial.transform import Rotation

TOLERANCE = 1e-9  # m


def _reference(sigma_0: float, delta_min: float, r_max: float):
    config = KISSConfig()
    config.adaptive_threshold.initial_threshold = sigma_0
    config.adaptive_threshold.min_motion_th = delta_min
    config.data.max_range = r_max
    return kiss_threshold.get_threshold_estimator(config)


def _series(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Deviations from none at all to half a turn, below and above the motion threshold."""
    poses = []
    for _ in range(count):
        pose = np.eye(4)
        axis = rng.normal(size=3)
        angle = rng.choice([0.0, 1e-6, 1e-4, 1e-3, 0.02, 1.0, np.pi - 1e-3])
        pose[:3, :3] = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()
        pose[:3, 3] = rng.normal(size=3) * rng.choice([0.0, 1e-3, 0.05, 0.5, 5.0])
        poses.append(pose)
    return poses


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("sigma_0", "delta_min", "r_max"), [(2.0, 0.1, 100.0), (0.7, 0.02, 30.0)])
def test_sigma_equals_the_package(seed, sigma_0, delta_min, r_max):
    ours = _core.KissThreshold(sigma_0, delta_min, r_max)
    theirs = _reference(sigma_0, delta_min, r_max)
    assert ours.sigma == pytest.approx(theirs.get_threshold(), abs=TOLERANCE)
    for deviation in _series(np.random.default_rng(seed), 200):
        ours.update(deviation)
        theirs.update_model_deviation(deviation)
        assert ours.sigma == pytest.approx(theirs.get_threshold(), abs=TOLERANCE)
    assert ours.sigma != pytest.approx(sigma_0, abs=1e-3)  # the series did move it


def test_the_rejector_cuts_at_three_sigma():
    rejector = _core.Rejector({"rejection.mode": "kiss"})
    theirs = _reference(2.0, 0.1, 100.0)
    for deviation in _series(np.random.default_rng(9), 50):
        rejector.begin_scan(np.eye(4))
        thresholds = rejector.threshold(np.array([0.0, 1.0, 90.0]))
        np.testing.assert_allclose(thresholds, 3.0 * theirs.get_threshold(), atol=TOLERANCE)
        rejector.end_scan(deviation)
        theirs.update_model_deviation(deviation)
