# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the offline comparison and the ROS nodes share.

Python 3.8 with NumPy alone, and nothing else of d2lio: the package `ros/d2lio_compare` holds a link
to this folder, and its nodes run under the Python of a ROS installation.
"""
