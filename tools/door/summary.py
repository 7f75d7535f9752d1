# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Sum of a test run: reads the reports of ctest, GoogleTest and pytest, prints one closing line.

``summary.py REPORTS [--ctest] [--pytest]`` expects, under REPORTS, what it is told was run:
``ctest.xml`` and ``gtest/BINARY.xml``, ``pytest.xml`` and ``pytest.status``. A runner or a binary
that died counts as one failure, whatever it had reported before. ``--left-out TEXT`` is what was
not built and so not tested; the closing line says it. Counts and that text are also written to
``REPORTS/counts``. Exits 1 on any failure and when no test passed.

``summary.py --sum COUNTS...`` adds up such files; a file that is missing counts as one failure.
Standard library only.
"""

from __future__ import annotations

import argparse
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Counts:
    """Numbers of test cases by outcome, and what was left out of the build."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    left_out: frozenset[str] = frozenset()

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.passed + other.passed,
            self.failed + other.failed,
            self.skipped + other.skipped,
            self.left_out | other.left_out,
        )

    def line(self) -> str:
        """The closing line, for example ``12 passed, 0 failed, 1 skipped``."""
        tail = f", {self.skipped} skipped" if self.skipped else ""
        left_out = f" (left out: {'; '.join(sorted(self.left_out))})" if self.left_out else ""
        return f"{self.passed} passed, {self.failed} failed{tail}{left_out}"

    def text(self) -> str:
        """What ``read_counts`` reads."""
        return "\n".join(
            [f"{self.passed} {self.failed} {self.skipped}", *sorted(self.left_out), ""]
        )


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
        numbers, *left_out = path.read_text().splitlines()
        passed, failed, skipped = (int(word) for word in numbers.split())
    except (OSError, ValueError):
        return ONE_FAILURE
    return Counts(passed, failed, skipped, frozenset(left_out))


def main(arguments: list[str]) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser()
    parser.add_argument("reports", type=Path, nargs="?")
    parser.add_argument("--ctest", action="store_true")
    parser.add_argument("--pytest", action="store_true")
    parser.add_argument("--left-out", action="append", default=[])
    parser.add_argument("--sum", type=Path, nargs="+", default=[])
    options = parser.parse_args(arguments)

    total = Counts(left_out=frozenset(options.left_out))
    for path in options.sum:
        total += read_counts(path)
    if options.reports:
        total += count_ctest(options.reports) if options.ctest else Counts()
        total += count_pytest(options.reports) if options.pytest else Counts()
        (options.reports / "counts").write_text(total.text())
    print(total.line(), flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
