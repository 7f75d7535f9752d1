# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The rigid motion that brings positions onto each other."""

from __future__ import annotations

import numpy as np

from d2lio.datasets.events import Float64


def align(points: Float64, target: Float64) -> tuple[Float64, Float64]:
    """R [3, 3], t [3] that move points [N, 3] onto their partners (Umeyama 1991, without scale)."""
    center, goal = points.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - goal).T @ (points - center))
    handed = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = U @ handed @ Vt
    return R, goal - R @ center


def aligned_rmse(first: Float64, second: Float64) -> float:
    """RMSE between positions [N, 3], m, after the best rotation and translation."""
    R, _ = align(second, first)
    rest = (first - first.mean(axis=0)) - (second - second.mean(axis=0)) @ R.T
    return float(np.sqrt((rest**2).sum(axis=1).mean()))
