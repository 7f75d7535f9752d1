# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Variants side by side on one sequence: offline, or out of ROS nodes."""
