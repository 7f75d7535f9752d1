# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""D²-LIO: degeneracy-aware LiDAR-inertial odometry, its simulator, runner and evaluation.

Importing the package is cheap: plotting, metrics and the estimators load where they are used.
"""

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as _version

try:
    __version__ = _version("d2lio")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0.1.0"

__all__ = ["__version__"]
