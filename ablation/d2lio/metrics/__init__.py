# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory metrics: coverage here, pose errors through evo."""

from d2lio.metrics.evaluate import FAIL_PERCENT, Curves, EvaluateOptions, Evaluation, evaluate
from d2lio.metrics.tum import Trajectory, read_tum

__all__ = [
    "FAIL_PERCENT",
    "Curves",
    "EvaluateOptions",
    "Evaluation",
    "Trajectory",
    "evaluate",
    "read_tum",
]
