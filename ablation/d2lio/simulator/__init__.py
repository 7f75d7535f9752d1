# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Simulated lidar-inertial sequences with exact ground truth."""

from __future__ import annotations

from d2lio.simulator.imu import IMU_GRADES
from d2lio.simulator.lidar import SENSORS
from d2lio.simulator.pipeline import Progress, Seeds, simulate
from d2lio.simulator.scenes import SCENES

__all__ = ["IMU_GRADES", "SCENES", "SENSORS", "Progress", "Seeds", "simulate"]
