# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Inserts the D2-LIO hooks into a FAST_LIO or LIO-SAM checkout, and takes them out again."""
