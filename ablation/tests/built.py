# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The hosts as test parameters; those that this build lacks are skipped with the reason."""

from __future__ import annotations

import pytest
from d2lio.hosts import HOSTS, NEED_GTSAM, liosam_missing

WHY_NOT = liosam_missing()
needs_gtsam = pytest.mark.skipif(WHY_NOT is not None, reason=WHY_NOT or "")


def host_params(names: tuple[str, ...] = tuple(HOSTS)) -> list:
    """One parameter per host, marked where it needs GTSAM."""
    return [pytest.param(name, marks=needs_gtsam if name in NEED_GTSAM else ()) for name in names]
