# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The archive GTSAM's tarball is fetched from: the one in this system's own apt configuration."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from fake_checkout import Door

ARCHIVE = "http://archive.example/debian"
ENTRY = f"Types: deb-src\nURIs: {ARCHIVE}\nSuites: trixie\nComponents: main\n"

ONE_LINE = f"""
# deb http://commented.example/debian bookworm main
deb cdrom:[Debian 12 _Bookworm_]/ bookworm main
deb-src http://sources.example/debian bookworm main
deb http://security.example/debian-security bookworm-security main
deb http://tools.example/apt stable non-free
deb {ARCHIVE} bookworm main contrib # the mirror
deb-src {ARCHIVE} bookworm main
"""
ONE_LINE_KEY = f"deb [arch=amd64 signed-by=/usr/share/keyrings/a.gpg] {ARCHIVE}   bookworm main\n"
DEB822 = f"""# the mirror
Types: deb deb-src
URIs: {ARCHIVE}
# kept for later: http://snapshot.example
Suites: bookworm bookworm-updates
Components: main non-free-firmware
Signed-By: /usr/share/keyrings/a.gpg

Types: deb
URIs: http://security.example/debian-security
Suites: bookworm-security
Components: main

Enabled: no
Types: deb
URIs: http://disabled.example/debian
Suites: bookworm
Components: main
"""
DEB822_INLINE_KEY = f"""Types: deb
URIs: {ARCHIVE}
Suites: bookworm
Components: main
Signed-By:
 -----BEGIN PGP PUBLIC KEY BLOCK-----
 .
 mDMEY865UxYJ
"""
SIGNED = "Signed-By: /usr/share/keyrings/a.gpg\n"
INLINE = "Signed-By: \n -----BEGIN PGP PUBLIC KEY BLOCK-----\n .\n mDMEY865UxYJ\n"


def trixie_sources(door: Door, work: Path) -> str:
    """Runs the recipe as far as the download, which fails; what it would have asked for."""
    script = door.root / "tools/door/build_gtsam.sh"
    done = subprocess.run(
        [script, work, work / "prefix"],
        env=door.environment | {"FAKE_SOURCE": "fails"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 12, done.stderr
    return (work / "trixie.sources").read_text() or done.stdout


@pytest.fixture
def etc(door: Door) -> Path:
    """The apt configuration's folder, its name with a space."""
    etc = Path(door.environment["HOME"]) / "etc apt"
    (etc / "sources.list.d").mkdir(parents=True)
    door.environment["APT_ETC"] = str(etc)
    return etc


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("sources.list", ONE_LINE, ENTRY),
        ("sources.list", ONE_LINE_KEY, ENTRY + SIGNED),
        ("sources.list.d/debian.list", ONE_LINE, ENTRY),
        ("sources.list.d/debian.sources", DEB822, ENTRY + SIGNED),
        ("sources.list.d/debian.sources", DEB822_INLINE_KEY, ENTRY + INLINE),
    ],
)
def test_archive_of_the_system_is_asked(
    door: Door, etc: Path, tmp_path: Path, name: str, text: str, expected: str
) -> None:
    (etc / name).write_text(text)
    assert trixie_sources(door, tmp_path / "a work") == expected + "\n"


def test_every_archive_that_may_be_debian_is_asked_once(
    door: Door, etc: Path, tmp_path: Path
) -> None:
    (etc / "sources.list").write_text(ONE_LINE)
    (etc / "sources.list.d/debian.sources").write_text(DEB822)
    (etc / "sources.list.d/robots.list").write_text("deb http://robots.example/x bookworm main\n")
    robots = ENTRY.replace(ARCHIVE, "http://robots.example/x")
    assert trixie_sources(door, tmp_path / "work") == f"{ENTRY}\n{robots}\n"


def test_configuration_without_debian_is_told(door: Door, etc: Path, tmp_path: Path) -> None:
    (etc / "sources.list").write_text("deb http://tools.example/apt noble main\n")
    assert "no Debian archive with main of 'bookworm'" in trixie_sources(door, tmp_path / "work")
