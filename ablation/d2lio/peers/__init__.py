# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Estimators of others, each in a virtual environment of its own (`d2lio peers`)."""

from d2lio.peers.catalog import PEERS, Peer

__all__ = ["PEERS", "Peer"]
