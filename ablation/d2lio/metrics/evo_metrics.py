# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Absolute and relative pose errors through evo.

evo is GPL-3 and therefore an optional dependency, imported only here and only when called.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

from d2lio.errors import DataError

Align = Literal["se3", "first", "none"]
RpeUnit = Literal["m", "f"]


def _evo() -> Any:
    try:
        import evo.main_ape
        import evo.main_rpe
        import evo.tools.file_interface
    except ImportError:
        raise DataError("evaluation needs evo: pip install 'd2lio[eval]'") from None
    return evo


def load_pair(truth: Path, estimate: Path, t_max_diff: float) -> tuple[Any, Any]:
    """Reads both TUM files and pairs their nearest stamps, as evo's command line does.

    Raises:
        DataError: no pair within `t_max_diff` seconds.
    """
    evo = _evo()
    from evo.core import sync

    read = evo.tools.file_interface.read_tum_trajectory_file
    try:
        return sync.associate_trajectories(
            read(str(truth)), read(str(estimate)), max_diff=t_max_diff
        )
    except sync.SyncException as err:
        raise DataError(f"{estimate} and {truth}: {err}") from None


def _copies(pair: tuple[Any, Any]) -> tuple[Any, Any]:
    import copy

    return copy.deepcopy(pair[0]), copy.deepcopy(pair[1])


def ape(pair: tuple[Any, Any], align: Align) -> Any:
    """evo's APE of the translation part, m; the result also holds the aligned trajectory.

    Raises:
        DataError: the alignment is not determined (fewer than three distinct positions).
    """
    evo = _evo()
    from evo.core.geometry import GeometryException
    from evo.core.metrics import PoseRelation

    truth, estimate = _copies(pair)
    try:
        return evo.main_ape.ape(
            truth,
            estimate,
            PoseRelation.translation_part,
            align=align == "se3",
            align_origin=align == "first",
        )
    except GeometryException as err:
        raise DataError(f"alignment: {err}") from None


def rpe(
    pair: tuple[Any, Any],
    kind: Literal["translation", "rotation", "distance"],
    delta: float,
    unit: RpeUnit,
) -> dict[str, float] | None:
    """evo's RPE statistics over consecutive pairs `delta` metres or frames apart.

    `distance` compares lengths only (for truth without orientation). None where the path is too
    short for a single pair.
    """
    evo = _evo()
    from evo.core.filters import FilterException
    from evo.core.metrics import MetricsException, PoseRelation, Unit

    relation = {
        "translation": PoseRelation.translation_part,
        "rotation": PoseRelation.rotation_angle_deg,
        "distance": PoseRelation.point_distance,
    }[kind]
    truth, estimate = _copies(pair)
    try:
        result = evo.main_rpe.rpe(
            truth,
            estimate,
            relation,
            delta=delta,
            delta_unit=Unit.meters if unit == "m" else Unit.frames,
        )
    except (FilterException, MetricsException):
        return None
    return {key: float(value) for key, value in result.stats.items()}


def aligned_positions(result: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps [N] in s, truth and aligned estimate positions float64 [N, 3] of an APE result."""
    truth, estimate = list(result.trajectories.values())
    return (
        np.asarray(estimate.timestamps),
        np.asarray(truth.positions_xyz),
        np.asarray(estimate.positions_xyz),
    )
