# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""For catkin_python_setup; not to be called by hand."""

from distutils.core import setup

from catkin_pkg.python_setup import generate_distutils_setup

setup(
    **generate_distutils_setup(
        packages=["d2lio_compare", "d2lio_compare.shared"], package_dir={"": "src"}
    )
)
