# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs inside a peer's own environment: numpy, the peer, and nothing of d2lio.

`serve.py` is started as a script, so its neighbours are found as top-level modules.
"""
