# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions of public data sets, one YAML file each; read by `d2lio.datasets.catalog`."""
