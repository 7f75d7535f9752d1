# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Allows `python -m d2lio`."""

from d2lio.cli import main

if __name__ == "__main__":
    main()
