# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The closing line of ``./d2lio test``: what counts, and that nothing that died is passed over."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from fake_checkout import REPOSITORY, Door

GTEST = """<testsuites><testsuite name="So3">
  <testcase name="Exp" status="run" result="completed"/>
  <testcase name="Log" status="run" result="completed">{log}</testcase>
  <testcase name="Later" status="notrun" result="suppressed"/>
  <testcase name="Data" status="run" result="skipped"><skipped/></testcase>
</testsuite></testsuites>"""
GTEST_GOOD = GTEST.format(log="")
GTEST_BAD = GTEST.format(log='<failure message="off by 1"/>')

CTEST_GOOD = '<testsuite><testcase name="test_geometry" status="run"/></testsuite>'
CTEST_BAD = (
    '<testsuite><testcase name="test_geometry" status="fail"><failure/></testcase></testsuite>'
)
CTEST_NOT_RUN = (
    '<testsuite><testcase name="test_geometry" status="notrun"><skipped/></testcase></testsuite>'
)
CTEST_DISABLED = '<testsuite><testcase name="test_geometry" status="disabled"/></testsuite>'

PYTEST_GOOD = """<testsuites><testsuite>
  <testcase name="a"/><testcase name="b"/><testcase name="c"><skipped/></testcase>
</testsuite></testsuites>"""
PYTEST_BAD = """<testsuites><testsuite>
  <testcase name="a"/><testcase name="b"><failure/></testcase><testcase name="c"><error/></testcase>
</testsuite></testsuites>"""
PYTEST_NONE = "<testsuites><testsuite/></testsuites>"


def close(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and output of summary.py."""
    command = [sys.executable, REPOSITORY / "tools/door/summary.py", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize(
    ("ctest", "gtest", "code", "line"),
    [
        (CTEST_GOOD, GTEST_GOOD, 0, "2 passed, 0 failed, 2 skipped"),
        (CTEST_BAD, GTEST_BAD, 1, "1 passed, 1 failed, 2 skipped"),
        (CTEST_GOOD, "", 0, "1 passed, 0 failed"),  # not a GoogleTest binary
        (CTEST_BAD, "", 1, "0 passed, 1 failed"),  # died before it could report
        (
            CTEST_BAD,
            GTEST_GOOD,
            1,
            "2 passed, 1 failed, 2 skipped",
        ),  # died after its report: a leak
        (CTEST_BAD, GTEST_GOOD[:150], 1, "0 passed, 1 failed"),  # died while reporting
        (CTEST_NOT_RUN, "", 1, "0 passed, 1 failed"),  # the binary is not there
        (CTEST_DISABLED, "", 1, "0 passed, 0 failed, 1 skipped"),
        ("<testsuite/>", "", 1, "0 passed, 0 failed"),
        ("", "", 1, "0 passed, 1 failed"),  # ctest itself died
    ],
)
def test_ctest_counts(tmp_path: Path, ctest: str, gtest: str, code: int, line: str) -> None:
    (tmp_path / "gtest").mkdir()
    (tmp_path / "ctest.xml").write_text(ctest)
    if gtest:
        (tmp_path / "gtest/test_geometry.xml").write_text(gtest)
    assert close(tmp_path, "--ctest") == (code, line + "\n")


@pytest.mark.parametrize(
    ("report", "status", "code", "line"),
    [
        (PYTEST_GOOD, "0", 0, "2 passed, 0 failed, 1 skipped"),
        (PYTEST_BAD, "1", 1, "1 passed, 2 failed"),
        (PYTEST_NONE, "5", 1, "0 passed, 0 failed"),  # no test was collected
        ("", "139", 1, "0 passed, 1 failed"),  # a crash in a native module
        (PYTEST_GOOD[:60], "139", 1, "0 passed, 1 failed"),
        (PYTEST_GOOD, "139", 1, "2 passed, 1 failed, 1 skipped"),  # a crash at exit
        (PYTEST_GOOD, "2", 1, "2 passed, 1 failed, 1 skipped"),  # interrupted
        ("", "0", 1, "0 passed, 1 failed"),
        (PYTEST_GOOD, "", 1, "2 passed, 1 failed, 1 skipped"),
    ],
)
def test_pytest_counts(tmp_path: Path, report: str, status: str, code: int, line: str) -> None:
    (tmp_path / "pytest.xml").write_text(report)
    (tmp_path / "pytest.status").write_text(status)
    assert close(tmp_path, "--pytest") == (code, line + "\n")


def test_parts_of_a_ci_run_add_up(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("3 0 1\n")
    (tmp_path / "b").write_text("4 0 0\n")
    assert close("--sum", tmp_path / "a", tmp_path / "b") == (0, "7 passed, 0 failed, 1 skipped\n")


def test_part_of_a_ci_run_that_did_not_end_counts_as_failed(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("3 0 1\n")
    missing = tmp_path / "missing"
    assert close("--sum", tmp_path / "a", missing) == (1, "3 passed, 1 failed, 1 skipped\n")


def test_what_was_left_out_is_said_at_the_end_and_once_for_a_ci_run(tmp_path: Path) -> None:
    for part in ("a", "b"):
        (tmp_path / part).mkdir()
        (tmp_path / part / "pytest.xml").write_text(PYTEST_GOOD)
        (tmp_path / part / "pytest.status").write_text("0")
        line = "2 passed, 0 failed, 1 skipped (left out: LIO-SAM)\n"
        assert close(tmp_path / part, "--pytest", "--left-out", "LIO-SAM") == (0, line)
    counts = [tmp_path / part / "counts" for part in ("a", "b")]
    assert close("--sum", *counts) == (0, "4 passed, 0 failed, 2 skipped (left out: LIO-SAM)\n")


# --- through the front door, with fake ctest and pytest


def test_all_tests_pass(door: Door) -> None:
    done = door.run("test", FAKE_CTEST=CTEST_GOOD, FAKE_GTEST=GTEST_GOOD, FAKE_PYTEST=PYTEST_GOOD)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "4 passed, 0 failed, 3 skipped"


def test_crash_of_a_binary_fails_the_run_and_python_is_still_tested(door: Door) -> None:
    done = door.run("test", FAKE_CTEST=CTEST_BAD, FAKE_CTEST_STATUS="8", FAKE_PYTEST=PYTEST_GOOD)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "2 passed, 1 failed, 1 skipped"


def test_reports_of_an_earlier_run_are_not_counted(door: Door) -> None:
    door.run("test", FAKE_CTEST=CTEST_GOOD, FAKE_GTEST=GTEST_GOOD, FAKE_PYTEST=PYTEST_GOOD)
    done = door.run("test", FAKE_CTEST=CTEST_BAD, FAKE_CTEST_STATUS="8", FAKE_PYTEST_STATUS="139")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "0 passed, 2 failed"


@pytest.mark.parametrize("option", ["--cpp", "--sanitize"])
def test_cpp_tests_need_no_python_environment(door: Door, option: str) -> None:
    done = door.run("test", option, FAKE_CTEST=CTEST_GOOD, FAKE_GTEST=GTEST_GOOD)
    assert done.stdout.splitlines()[-1] == "2 passed, 0 failed, 2 skipped"
    assert door.calls() == []


def test_python_tests_alone(door: Door) -> None:
    done = door.run("test", "--python", "--", "-k", "bag", FAKE_PYTEST=PYTEST_GOOD)
    assert done.stdout.splitlines()[-1] == "2 passed, 0 failed, 1 skipped"
    assert "-k bag" in Path(door.environment["CALLS"]).read_text()


def test_code_that_does_not_compile_is_one_line(door: Door) -> None:
    door.run("setup")
    done = door.run("test", "--cpp", FAKE_BUILD="fails")
    assert done.returncode == 15
    assert done.stderr.splitlines()[-1].startswith(
        "d2lio: configuring the C++ code (release) failed"
    )
    assert "so3.cpp:12:3: error" in done.stderr
