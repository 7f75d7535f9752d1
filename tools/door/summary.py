# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Sum of a test run: reads the reports of ctest, GoogleTest and pytest, prints one closing line.

``summary.py REPORTS [--ctest] [--pytest]`` expects, under REPORTS, what it is told was run:
``ctest.xml`` and ``gtest/BINARY.xml``, ``pytest.xml`` and ``pytest.status``. A runner or a binary
that died counts as one failure, whatever it had reported before. The counts are also written to
``REPORTS/counts``. Exits 1 on any failure and when no test passed.

``summary.py --sum COUNTS...`` adds up such files; a file that is missing counts as one failure.
Standard library only.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Counts:
    """Numbers of test cases by outcome."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped
        )

    def line(self) -> str:
        """The closing line, for example ``12 passed, 0 failed, 1 skipped``."""
        tail = f", {self.skipped} skipped" if self.skipped else ""
        return f"{self.passed} passed, {self.failed} failed{tail}"


ONE_FAILURE = Counts(failed=1)


def _parse(path: Path) -> ET.Element | None:
    """Root of an XML report; None where it is missing or was cut off."""
    try:
        return ET.parse(path).getroot()
    except (OSError, ET.ParseError):
        return None


def _count_cases(root: ET.Element) -> Counts:
    """Outcomes of the ``testcase`` elements of a GoogleTest or pytest report."""
    total = Counts()
    for case in root.iter("testcase"):
        if case.find("failure") is not None or case.find("error") is not None:
            total += ONE_FAILURE
        elif (
            case.find("skipped") is not None
            or case.get("status") == "notrun"
            or case.get("result") in ("skipped", "suppressed")
        ):
            total += Counts(skipped=1)
        else:
            total += Counts(passed=1)
    return total


def count_ctest(reports: Path) -> Counts:
    """GoogleTest cases of every ctest entry; the entry itself where a binary left no report."""
    root = _parse(reports / "ctest.xml")
    if root is None:
        return ONE_FAILURE
    total = Counts()
    for entry in root.iter("testcase"):
        if entry.get("status") == "disabled":
            total += Counts(skipped=1)
            continue
        ok = entry.get("status") == "run" and entry.find("failure") is None
        report = _parse(reports / "gtest" / f"{entry.get('name')}.xml")
        cases = _count_cases(report) if report is not None else Counts(passed=1 if ok else 0)
        died = not ok and cases.failed == 0
        total += cases + (ONE_FAILURE if died else Counts())
    return total


def count_pytest(reports: Path) -> Counts:
    """Pytest's cases; one failure more when it ended in a way that its report does not show."""
    try:
        status = int((reports / "pytest.status").read_text())
    except (OSError, ValueError):
        status = -1
    root = _parse(reports / "pytest.xml")
    cases = _count_cases(root) if root is not None else Counts()
    no_tests_collected = 5
    if status in (0, no_tests_collected) and root is not None:
        return cases
    return cases if cases.failed else cases + ONE_FAILURE


def read_counts(path: Path) -> Counts:
    """Counts written by an earlier run; one failure where that run did not get so far."""
    try:
        return Counts(*(int(word) for word in path.read_text().split()))
    except (OSError, ValueError, TypeError):
        return ONE_FAILURE


def main(arguments: list[str]) -> int:
    """Entry point; returns the exit code."""
    total = Counts()
    if arguments[0] == "--sum":
        for name in arguments[1:]:
            total += read_counts(Path(name))
    else:
        reports = Path(arguments[0])
        total += count_ctest(reports) if "--ctest" in arguments else Counts()
        total += count_pytest(reports) if "--pytest" in arguments else Counts()
        (reports / "counts").write_text(f"{total.passed} {total.failed} {total.skipped}\n")
    print(total.line(), flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
