# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Where set-up takes GTSAM from, and that its build is kept, resumed, shared and explained."""

from __future__ import annotations

import fcntl
import os
import signal
from pathlib import Path

import pytest
from fake_checkout import ALL_PACKAGES, GTSAM_NEEDS, TIME_LIMIT_S, Door, wait_for
from test_closing_line import CTEST_GOOD, GTEST_GOOD, PYTEST_GOOD

LEFT_OUT = "(left out: LIO-SAM host: D2LIO_GTSAM=off)"
LEFT_OUT_OFFLINE = "none is installed and D2LIO_OFFLINE is set"


@pytest.fixture
def old_debian(door: Door) -> Door:
    """A checkout on a distribution without libgtsam-dev; a downloaded tarball is taken as right."""
    door.install_packages(*(name for name in ALL_PACKAGES if name != "libgtsam-dev"))
    door.environment["FAKE_CANDIDATE"] = "(none)"
    sources = Path(door.environment["APT_ETC"]) / "sources.list"
    sources.parent.mkdir()
    sources.write_text("deb http://archive.example/debian bookworm main\n")
    real = (door.bin / "sha256sum").readlink()
    check = '[ -e gtsam_4.2.0+dfsg.orig.tar.xz ] && [ "${FAKE_SHA:-right}" = right ]'
    door.fake("sha256sum", f'case "$1" in --check) {check} ;; *) exec {real} "$@" ;; esac')
    return door


def prefixes(door: Door) -> list[Path]:
    """Whole builds of GTSAM in the user's cache."""
    return sorted((Path(door.environment["HOME"]) / ".cache/d2lio").glob("gtsam-*"))


def raw_calls(door: Door) -> str:
    return Path(door.environment["CALLS"]).read_text()


# --- from the distribution


def test_package_of_the_distribution_is_installed_with_what_it_is_linked_to(door: Door) -> None:
    door.install_packages(*set(ALL_PACKAGES) - {*GTSAM_NEEDS, "libgtsam-dev"})
    door.fake("id", "echo 0")
    done = door.run("setup")
    assert done.returncode == 0, done.stderr
    assert "[1/5] system packages: libboost-chrono-dev" in done.stderr
    assert "libgtsam-dev" in done.stderr
    assert "-DD2LIO_GTSAM=ON" in raw_calls(door)
    assert door.calls() == ["apt", "venv", "pip", "build"]
    assert door.run("setup").stderr == ""


def test_machine_without_package_lists_fetches_them_before_it_decides(door: Door) -> None:
    door.install_packages(*set(ALL_PACKAGES) - {"libgtsam-dev"})
    door.fake("id", "echo 0")
    done = door.run("setup", FAKE_NO_LISTS="1")
    assert "[1/5] system packages: libgtsam-dev" in done.stderr
    assert "gtsam" not in door.calls()


def test_package_of_another_series_is_not_taken(old_debian: Door) -> None:
    old_debian.run("setup", FAKE_CANDIDATE="4.3.0-1")
    assert "gtsam" in old_debian.calls()


# --- built


def test_is_built_once_for_all_checkouts_and_cmake_finds_it(old_debian: Door) -> None:
    first = old_debian.run("setup")
    assert first.returncode == 0, first.stderr
    assert "[2/5] building GTSAM 4.2.0 once, about 4 minutes on two cores" in first.stderr
    (prefix,) = prefixes(old_debian)
    assert f"CMAKE_PREFIX_PATH {prefix}\n" in raw_calls(old_debian)
    assert old_debian.calls() == ["gtsam", "venv", "pip", "build"]
    assert not list(prefix.parent.glob(".work*"))

    assert old_debian.run("setup").stderr == ""
    other = old_debian.root.with_name("other")
    old_debian.root.rename(other)
    old_debian.root = old_debian.cwd = other
    (other / ".venv/bin/python").unlink()
    assert old_debian.run("setup").returncode == 0
    assert "gtsam" not in old_debian.calls()


@pytest.mark.parametrize("option", ["--cpp", "--sanitize"])
def test_cpp_builds_find_it_without_a_python_environment(old_debian: Door, option: str) -> None:
    done = old_debian.run("test", option, FAKE_CTEST=CTEST_GOOD, FAKE_GTEST=GTEST_GOOD)
    assert done.stdout.splitlines()[-1] == "2 passed, 0 failed, 2 skipped"
    (prefix,) = prefixes(old_debian)
    log = raw_calls(old_debian)
    assert f"CMAKE_PREFIX_PATH {prefix}\n" in log
    assert "-UGTSAM_* -DD2LIO_GTSAM=ON" in log


def test_cache_is_where_the_user_wants_it_and_goes_before_other_prefixes(
    old_debian: Door, tmp_path: Path
) -> None:
    cache = tmp_path / "a cache"
    old_debian.run("setup", D2LIO_CACHE=str(cache), CMAKE_PREFIX_PATH="/opt/ros/x")
    (prefix,) = cache.glob("gtsam-*")
    assert f"CMAKE_PREFIX_PATH {prefix}:/opt/ros/x\n" in raw_calls(old_debian)
    assert prefixes(old_debian) == []


@pytest.mark.parametrize(
    "change", [{"CXXFLAGS": "-march=native"}, {"CXX": "clang++"}], ids=["flags", "compiler"]
)
def test_other_compiler_or_recipe_gets_another_build(
    old_debian: Door, change: dict[str, str]
) -> None:
    old_debian.run("setup")
    old_debian.calls()
    assert old_debian.run("setup", **change).returncode == 0
    assert old_debian.calls() == ["gtsam", "build"]
    with (old_debian.root / "tools/door/gtsam.patch").open("a") as patch:
        patch.write("\n")
    assert old_debian.run("setup").returncode == 0
    assert old_debian.calls() == ["gtsam", "build"]
    assert len(prefixes(old_debian)) == 3


def test_lost_cache_is_built_again(old_debian: Door) -> None:
    old_debian.run("setup")
    old_debian.calls()
    for prefix in prefixes(old_debian):
        prefix.rename(prefix.with_name("away"))
    assert old_debian.run("setup").returncode == 0
    assert old_debian.calls() == ["gtsam"]


# --- interrupted, and two at once


@pytest.mark.parametrize("signal_number", [signal.SIGTERM, signal.SIGKILL])
def test_stopped_build_goes_on_where_it_was(old_debian: Door, signal_number: int) -> None:
    process = old_debian.start("setup", FAKE_GTSAM="hang")
    pid_file = Path(old_debian.environment["PIP_PID"])
    wait_for(pid_file)
    process.send_signal(signal_number)
    process.communicate(timeout=TIME_LIMIT_S) if signal_number == signal.SIGTERM else process.wait()
    if signal_number == signal.SIGKILL:
        os.kill(int(pid_file.read_text()), signal.SIGKILL)
    (work,) = (Path(old_debian.environment["HOME"]) / ".cache/d2lio").glob(".work-gtsam-*")
    assert (work / "build/first.o").exists()
    assert prefixes(old_debian) == []

    old_debian.calls()
    old_debian.fake("patch", "exit 1")  # neither fetched nor unpacked again
    done = old_debian.run("setup", FAKE_SOURCE="fails")
    assert done.returncode == 0, done.stderr
    assert "gtsam" in old_debian.calls()
    assert len(prefixes(old_debian)) == 1


def test_second_checkout_waits_for_the_build_of_the_first(old_debian: Door) -> None:
    cache = Path(old_debian.environment["HOME"]) / ".cache/d2lio"
    cache.mkdir(parents=True)
    with (cache / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        process = old_debian.start("setup")
        assert process.stderr is not None
        assert "waiting" in process.stderr.readline()
        assert old_debian.calls() == []
        fcntl.flock(lock, fcntl.LOCK_UN)
        process.communicate(timeout=TIME_LIMIT_S)
    assert process.returncode == 0
    assert "gtsam" in old_debian.calls()


# --- left out, and failures


def test_off_leaves_it_out_and_the_closing_line_says_so(old_debian: Door) -> None:
    done = old_debian.run(
        "test",
        D2LIO_GTSAM="off",
        FAKE_CTEST=CTEST_GOOD,
        FAKE_GTEST=GTEST_GOOD,
        FAKE_PYTEST=PYTEST_GOOD,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"4 passed, 0 failed, 3 skipped {LEFT_OUT}"
    assert "the LIO-SAM host is left out" in done.stderr
    assert raw_calls(old_debian).count("-DD2LIO_GTSAM=OFF") == 2
    assert "gtsam" not in old_debian.calls()


def test_switching_it_on_again_builds_the_package_anew(old_debian: Door) -> None:
    old_debian.run("setup", D2LIO_GTSAM="off")
    old_debian.calls()
    assert old_debian.run("setup", D2LIO_GTSAM="off").stderr == ""
    assert old_debian.run("setup").returncode == 0
    assert old_debian.calls() == ["gtsam", "build"]


def test_offline_without_it_works_and_says_what_is_left_out(old_debian: Door) -> None:
    old_debian.run("setup", D2LIO_GTSAM="off")
    done = old_debian.run("test", "--python", D2LIO_OFFLINE="1", FAKE_PYTEST=PYTEST_GOOD)
    assert done.returncode == 0, done.stderr
    assert LEFT_OUT_OFFLINE in done.stderr + done.stdout
    assert LEFT_OUT_OFFLINE in done.stdout.splitlines()[-1]
    assert "gtsam" not in old_debian.calls()


def test_offline_with_a_cached_build_has_it(old_debian: Door) -> None:
    old_debian.run("setup")
    done = old_debian.run("test", "--python", D2LIO_OFFLINE="1", FAKE_PYTEST=PYTEST_GOOD)
    assert done.stdout.splitlines()[-1] == "2 passed, 0 failed, 1 skipped"


def failure(door: Door, **settings: str) -> tuple[int, str]:
    """Exit code and the one line of a set-up that fails before the Python environment."""
    done = door.run("setup", **settings)
    assert done.stderr.count("d2lio: ") == 1
    assert "venv" not in door.calls()
    assert prefixes(door) == []
    return done.returncode, done.stderr.splitlines()[-1]


def test_on_fails_offline(old_debian: Door) -> None:
    code, line = failure(old_debian, D2LIO_GTSAM="on", D2LIO_OFFLINE="1")
    assert (code, LEFT_OUT_OFFLINE in line) == (12, True)


def test_unknown_choice_is_refused(old_debian: Door) -> None:
    code, line = failure(old_debian, D2LIO_GTSAM="maybe")
    assert (code, "auto, on or off" in line) == (2, True)


@pytest.mark.parametrize(
    ("settings", "code", "words"),
    [
        ({"FAKE_SOURCE": "fails"}, 12, "apt-get source gtsam failed"),
        ({"FAKE_SHA": "wrong"}, 12, "sha256 differs"),
        ({"FAKE_GTSAM": "fails"}, 15, "Pose3.cpp:7:1: error: expected ;"),
        ({"FAKE_GTSAM": "full"}, 13, "the disk is full"),
    ],
    ids=["download", "checksum", "compiler", "disk"],
)
def test_failed_build_is_one_line_and_the_next_call_repairs_it(
    old_debian: Door, settings: dict[str, str], code: int, words: str
) -> None:
    ended, line = failure(old_debian, **settings)
    assert ended == code
    assert words in line
    assert "D2LIO_GTSAM=off" in line
    assert str(old_debian.root / "build/log/gtsam.log") in line
    assert old_debian.run("setup").returncode == 0


def test_lost_connection_is_told(old_debian: Door) -> None:
    old_debian.fake(
        "apt-get",
        'case "$*" in *update*) echo "W: Failed to fetch x  Could not resolve" ;; esac; exit 100',
    )
    code, line = failure(old_debian)
    assert (code, "Could not resolve" in line) == (12, True)


def test_too_little_space_for_the_cache_is_told(old_debian: Door) -> None:
    cache = '*/.cache/*) echo "x 9 9 1048 9% /" ;; *) echo "x 9 9 9999999 9% /" ;;'
    old_debian.fake("df", f'echo head; case "$*" in {cache} esac')
    code, line = failure(old_debian)
    assert code == 13
    assert "1 MiB free" in line
    assert "512 MiB" in line
