# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the front door's tests."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from fake_checkout import ALL_PACKAGES, FAKES, REAL_TOOLS, Door, copy_front_door


@pytest.fixture
def door(tmp_path: Path) -> Door:
    """A checkout whose path has a space in it, on a machine with all system packages."""
    root, bin_ = tmp_path / "my checkout" / "d2lio", tmp_path / "bin"
    copy_front_door(root)
    bin_.mkdir()
    for tool in [*REAL_TOOLS, "cp", "chmod"]:
        (bin_ / tool).symlink_to(shutil.which(tool))
    (tmp_path / "os-release").write_text(
        'ID=debian\nVERSION_ID="12"\nVERSION_CODENAME=bookworm\nPRETTY_NAME="Debian 12"\n'
    )
    environment = {
        "PATH": str(bin_),
        "HOME": str(tmp_path),
        "CALLS": str(tmp_path / "calls"),
        "INSTALLED": str(tmp_path / "installed"),
        "PIP_PID": str(tmp_path / "pip.pid"),
        "APT_ETC": str(tmp_path / "apt"),
        "REAL_PYTHON": sys.executable,
        "D2LIO_PYTHON": str(bin_ / "python3"),
        "D2LIO_OS_RELEASE": str(tmp_path / "os-release"),
        "FAKE_CANDIDATE": "4.2.0+dfsg-1",
        "FAKE_CTEST": "",
        "FAKE_GTEST": "",
        "FAKE_PYTEST": "",
    }
    made = Door(root, bin_, environment)
    for name, body in FAKES.items():
        made.fake(name, f'echo "${{0##*/}} $*" >>"$CALLS"\n{body}')
    Path(environment["CALLS"]).write_text("")
    made.install_packages(*ALL_PACKAGES)
    return made
