# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Set-up of the front door: incremental, resumable, and one clear line for every failure."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
from pathlib import Path

import pytest
from fake_checkout import ALL_PACKAGES, TIME_LIMIT_S, Door, wait_for

SETUP_CALLS = ["venv", "pip", "build"]


def assert_fails(done: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    """One line with our prefix ends stderr, stdout is empty, and the code is the documented one."""
    last = done.stderr.splitlines()[-1]
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert last.startswith("d2lio: ")
    assert done.stderr.count("d2lio: ") == 1
    for word in words:
        assert word in last


# --- what it does when all goes well


def test_first_call_sets_up_and_second_call_does_nothing(door: Door) -> None:
    first = door.run("demo")
    assert first.returncode == 0, first.stderr
    assert door.calls() == SETUP_CALLS
    assert [line[:5] for line in first.stderr.splitlines()] == ["[3/5]", "[4/5]", "[5/5]"]

    second = door.run("demo")
    assert second.returncode == 0
    assert second.stderr == ""
    assert door.calls() == []


def test_verbs_are_passed_on_with_their_arguments_and_folder(door: Door, tmp_path: Path) -> None:
    door.cwd = tmp_path
    done = door.run("run", "a sequence", "--set", "rejection.tau=1 2", "")
    assert done.stdout == f"<{tmp_path}><run><a sequence><--set><rejection.tau=1 2><>"


def test_works_through_a_symbolic_link(door: Door, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(door.root / "d2lio")
    done = subprocess.run([link, "setup"], env=door.environment, capture_output=True, check=False)
    assert done.returncode == 0
    assert (door.root / ".venv/bin/d2lio").exists()


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ("common/src/so3.cpp", ["build"]),
        ("ablation/d2lio/cli.py", ["build"]),
        ("common/src/new_file.cpp", ["build"]),
        ("pyproject.toml", ["build"]),  # read again; but nothing is missing, so no pip
        ("common/tests/test_so3.cpp", []),
    ],
)
def test_only_what_changed_is_done_again(door: Door, changed: str, expected: list[str]) -> None:
    door.run("setup")
    door.calls()
    with (door.root / changed).open("a") as file:
        file.write("# two\n")
    assert door.run("setup").returncode == 0
    assert door.calls() == expected


def test_moved_checkout_gets_a_new_environment(door: Door) -> None:
    door.run("setup")
    door.calls()
    door.root = door.root.rename(door.root.with_name("moved"))
    door.cwd = door.root
    (door.root / ".venv/bin/python").unlink()  # the fake has no path of its own that could break
    assert door.run("setup").returncode == 0
    assert door.calls() == SETUP_CALLS


def test_half_made_environment_is_made_anew(door: Door) -> None:
    (door.root / ".venv/bin").mkdir(parents=True)
    (door.root / ".venv/bin/python").write_text("#!/bin/sh\nexit 1\n")
    (door.root / ".venv/bin/python").chmod(0o755)
    assert door.run("setup").returncode == 0
    assert door.calls() == SETUP_CALLS


def test_missing_system_packages_are_installed_by_name(door: Door) -> None:
    door.install_packages(*(name for name in ALL_PACKAGES if name != "libtbb-dev"))
    door.fake("id", "echo 0")
    done = door.run("setup")
    assert done.returncode == 0, done.stderr
    assert "[1/5] system packages: libtbb-dev" in done.stderr
    assert "apt" in door.calls()


def test_sudo_is_used_by_others_than_root(door: Door) -> None:
    door.install_packages()
    door.fake("id", "echo 1000")
    assert door.run("setup").returncode == 0
    assert "apt" in door.calls()


BROWSER = {"chromium", "chromium-driver", "fonts-dejavu-core"}


@pytest.mark.parametrize(
    ("verb", "skip", "wanted"),
    [
        (("test", "--python"), "0", True),
        (("test", "--python"), "1", False),
        (("setup",), "0", False),
    ],
)
def test_python_tests_bring_a_browser(
    door: Door, verb: tuple[str, ...], skip: str, wanted: bool
) -> None:
    door.install_packages(*(name for name in ALL_PACKAGES if name not in BROWSER))
    door.fake("id", "echo 0")
    door.run(*verb, D2LIO_SKIP_BROWSER=skip, FAKE_PYTEST="<testsuites/>")
    installed = set(Path(door.environment["INSTALLED"]).read_text().split())
    assert (installed >= BROWSER) == wanted
    assert wanted or not installed & BROWSER


# --- how it fails


@pytest.mark.parametrize("sudo", ["refuses", "absent"])
def test_missing_root_right(door: Door, sudo: str) -> None:
    door.install_packages("cmake", "build-essential")
    door.fake("id", "echo 1000")
    if sudo == "absent":
        (door.bin / "sudo").unlink()
    done = door.run("setup", FAKE_SUDO="refuses")
    assert_fails(done, 11, "root", "apt-get install", "libeigen3-dev", "python3-venv")
    assert door.calls() == []


def test_unsupported_system(door: Door) -> None:
    Path(door.environment["D2LIO_OS_RELEASE"]).write_text('ID=fedora\nPRETTY_NAME="Fedora 40"\n')
    assert_fails(door.run("setup"), 10, "unsupported system", "Fedora 40")


def test_no_apt(door: Door) -> None:
    (door.bin / "apt-get").unlink()
    assert_fails(door.run("setup"), 10, "unsupported system")


def test_old_python(door: Door) -> None:
    assert_fails(door.run("setup", FAKE_VERSION="old"), 10, "older than Python 3.11")


def test_no_compiler(door: Door) -> None:
    (door.bin / "c++").unlink()
    assert_fails(door.run("setup"), 14, "'c++'")


def test_failed_apt_download_shows_its_line_and_log(door: Door) -> None:
    door.install_packages()
    door.fake("id", "echo 0")
    done = door.run("setup", FAKE_APT="fails")
    assert_fails(done, 12, "Could not connect", str(door.root / "build/log/apt.log"))


def test_failed_pip_download_shows_its_line_and_the_next_call_goes_on(door: Door) -> None:
    assert_fails(door.run("setup", FAKE_PIP="download"), 12, "No matching distribution", "pip.log")
    assert door.calls() == ["venv", "pip"]
    assert door.run("setup").returncode == 0
    assert door.calls() == ["pip", "build"]


def test_lost_connection_is_told_rather_than_what_pip_concludes_from_it(door: Door) -> None:
    done = door.run("setup", FAKE_PIP="unreachable")
    assert_fails(done, 12, "connection broken by 'ReadTimeoutError")
    assert "No matching" not in done.stderr


def test_failed_build_shows_the_compiler_line(door: Door) -> None:
    done = door.run("setup", FAKE_BUILD="fails")
    assert_fails(done, 15, "so3.cpp:12:3: error: expected ;", "package.log")
    door.calls()
    assert door.run("setup").returncode == 0
    assert door.calls() == ["build"]


def test_disk_that_fills_up_while_pip_works(door: Door) -> None:
    assert_fails(door.run("setup", FAKE_PIP="full"), 13, "the disk is full", "pip.log")
    door.calls()
    assert door.run("setup").returncode == 0
    assert door.calls() == SETUP_CALLS  # what pip had half unpacked is not trusted


def test_too_little_free_space_is_told_before_anything_is_done(door: Door) -> None:
    door.fake("df", "echo head; echo 'x 9999999 9999999 1048576 99% /'")
    assert_fails(door.run("setup"), 13, "the disk is full", "1024 MiB free")
    assert door.calls() == []


@pytest.mark.parametrize("fill", [False, True])
def test_small_and_full_file_system(door: Door, fill: bool) -> None:
    """A real file system of 4 MiB, in a mount name space of its own."""
    probe = ["unshare", "-m", "sh", "-c", "mount -t tmpfs none /mnt"]
    if subprocess.run(probe, capture_output=True, check=False).returncode:
        pytest.skip("this machine does not let us mount a small file system")
    script = """
        mount -t tmpfs -o size=4m none "$2" && cp -r "$1/." "$2" || exit 99
        [ "$3" = True ] && { cat /dev/zero >"$2/filler" 2>/dev/null; true; }
        export PATH="$4"; exec "$2/d2lio" setup
    """
    target = door.root.parent / "small"
    target.mkdir()
    command = ["unshare", "-m", "sh", "-c", script, "sh", door.root, target, str(fill), door.bin]
    environment = door.environment | {"PATH": os.environ["PATH"]}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert_fails(done, 13, "the disk is full")


def test_offline_names_what_is_missing_and_calls_nobody(door: Door) -> None:
    assert_fails(door.run("setup", D2LIO_OFFLINE="1"), 12, "D2LIO_OFFLINE", "numpy>=1.26")
    door.install_packages("cmake")
    assert_fails(door.run("setup", D2LIO_OFFLINE="1"), 12, "D2LIO_OFFLINE", "libtbb-dev")
    assert not {"pip", "apt"} & set(door.calls())


def test_offline_works_when_all_is_there(door: Door) -> None:
    door.run("setup")
    (door.root / "ablation/d2lio/cli.py").write_text("two\n")
    assert door.run("setup", D2LIO_OFFLINE="1").returncode == 0


# --- two at once, and interruptions


def test_second_call_waits_for_the_first_with_a_message(door: Door) -> None:
    (door.root / "build").mkdir()
    with (door.root / "build/.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        process = door.start("setup")
        assert process.stderr is not None
        assert "another ./d2lio is at work" in process.stderr.readline()
        assert door.calls() == []
        fcntl.flock(lock, fcntl.LOCK_UN)
        process.communicate(timeout=TIME_LIMIT_S)
    assert process.returncode == 0
    assert door.calls() == SETUP_CALLS


def test_interrupted_set_up_ends_its_child_and_the_next_call_resumes(door: Door) -> None:
    process = door.start("setup", FAKE_PIP="hang")
    pid_file = Path(door.environment["PIP_PID"])
    wait_for(pid_file)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=TIME_LIMIT_S)
    assert process.returncode == 130
    assert "d2lio: interrupted" in err
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid_file.read_text()), 0)

    door.calls()
    assert door.run("setup").returncode == 0
    assert door.calls() == SETUP_CALLS  # the half-unpacked packages looked whole to pip


def test_killed_set_up_is_repaired_by_the_next_call(door: Door) -> None:
    process = door.start("setup", FAKE_PIP="hang")
    pid_file = Path(door.environment["PIP_PID"])
    wait_for(pid_file)
    process.kill()
    process.wait(timeout=TIME_LIMIT_S)

    waiting = door.start("setup")
    assert waiting.stderr is not None
    assert "another ./d2lio is at work" in waiting.stderr.readline()  # the orphaned pip goes on
    os.kill(int(pid_file.read_text()), signal.SIGKILL)
    door.calls()
    waiting.communicate(timeout=TIME_LIMIT_S)
    assert waiting.returncode == 0
    assert door.calls() == SETUP_CALLS


# --- help and usage


def test_help_lists_the_verbs_and_needs_no_set_up(door: Door) -> None:
    done = door.run("--help")
    assert done.returncode == 0
    for verb in ("demo", "test", "bench", "lint", "setup", "run, simulate, evaluate, params"):
        assert f"\n  {verb}" in done.stdout
    assert door.calls() == []


@pytest.mark.parametrize("arguments", [(), ("test", "--no-such-option"), ("lint", "x")])
def test_wrong_usage_does_nothing_and_gives_2(door: Door, arguments: tuple[str, ...]) -> None:
    done = door.run(*arguments)
    assert done.returncode == 2
    assert done.stderr
    assert door.calls() == []
