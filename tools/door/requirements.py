# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Requirements of a checkout, read from pyproject.toml, so that they are written down once.

``requirements.py PYPROJECT EXTRA...`` prints what the package, its build and the extras need.
``requirements.py --no-deps PYPROJECT`` prints what is to be installed without its dependencies.
``requirements.py --missing FILE...`` prints those of their lines that are not met here.
Standard library and pip only: it runs before anything else is installed.
"""

from __future__ import annotations

import sys
import tomllib
from importlib import metadata
from pathlib import Path


def requirements(pyproject: Path, extras: list[str]) -> list[str]:
    """Requirement lines of the build system, the package and the named extras, sorted."""
    document = tomllib.loads(pyproject.read_text())
    project = document["project"]
    lines = set(document["build-system"]["requires"]) | set(project["dependencies"])
    for extra in extras:
        lines |= set(project["optional-dependencies"][extra])
    return sorted(lines)


def missing(lines: list[str]) -> list[str]:
    """Lines that the running environment does not meet (one level deep, as pip keeps the rest)."""
    from pip._vendor.packaging.requirements import Requirement

    unmet = []
    for line in lines:
        requirement = Requirement(line)
        if requirement.marker and not requirement.marker.evaluate():
            continue
        try:
            version = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            unmet.append(line)
            continue
        if not requirement.specifier.contains(version, prereleases=True):
            unmet.append(line)
    return unmet


def main(arguments: list[str]) -> None:
    """Entry point; see the module's description."""
    if arguments[0] == "--missing":
        lines = missing(
            [line for name in arguments[1:] for line in Path(name).read_text().splitlines()]
        )
    elif arguments[0] == "--no-deps":
        lines = tomllib.loads(Path(arguments[1]).read_text())["tool"]["d2lio"][
            "without-dependencies"
        ]
    else:
        lines = requirements(Path(arguments[0]), arguments[1:])
    print("".join(f"{line}\n" for line in lines), end="")


if __name__ == "__main__":
    main(sys.argv[1:])
