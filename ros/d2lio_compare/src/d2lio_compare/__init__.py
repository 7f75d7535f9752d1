# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Variants of LiDAR-inertial odometry side by side, as ROS nodes."""
