# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Entry of ``python3 patches/tool``: what ``./d2lio patch`` starts, without any set-up."""

import sys

if sys.version_info < (3, 8):  # noqa: UP036 (any Python may start this)
    sys.exit("d2lio patch: needs Python 3.8 or newer; name one with D2LIO_PYTHON=PATH")

from d2lio_patch.cli import main

sys.exit(main(sys.argv[1:]))
