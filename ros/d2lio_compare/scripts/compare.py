#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Starts the variants of a comparison; see launch/compare.launch."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "src"))  # in a source tree

from d2lio_compare.launcher import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
