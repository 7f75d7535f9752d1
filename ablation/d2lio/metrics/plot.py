# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A figure of one evaluation."""

from __future__ import annotations

from pathlib import Path

from d2lio.errors import ConfigError
from d2lio.metrics.evaluate import Curves, Evaluation

SUFFIXES = (".png", ".svg", ".pdf")


def plot_curves(curves: Curves, result: Evaluation, path: Path) -> None:
    """Top view, side view and error over time.

    Raises:
        ConfigError: a file type that is not png, svg or pdf.
    """
    if path.suffix not in SUFFIXES:
        raise ConfigError("plot", str(path), ", ".join(SUFFIXES))
    from matplotlib.figure import Figure  # no pyplot: no display, no global state

    figure = Figure(figsize=(9, 7), layout="constrained")
    top, side, error = figure.subplots(3, 1, height_ratios=[3, 1.5, 1.5])
    for axis, (a, b) in ((top, (0, 1)), (side, (0, 2))):
        axis.plot(curves.truth[:, a], curves.truth[:, b], color="0.5", label="truth")
        axis.plot(curves.estimate[:, a], curves.estimate[:, b], lw=1.0, label="estimate")
        axis.set_xlabel("x [m]")
        axis.set_ylabel(f"{'xyz'[b]} [m]")
    top.set_aspect("equal", adjustable="datalim")
    top.legend()
    error.plot(curves.t, curves.error)
    error.set_xlabel("time [s]")
    error.set_ylabel("error [m]")
    if result.ate is not None:
        figure.suptitle(f"ATE {result.ate.rmse:.4f} m RMSE, aligned: {result.align}")
    figure.savefig(path, dpi=150)
