# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Patching and taking back: idempotent, byte for byte, whatever the files look like."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fake_checkout import REPOSITORY, Door
from patch_standins import HOSTS, commit, edit, make, patch, snapshot, source_name, write

SOURCE = source_name("fast_lio")


@pytest.mark.parametrize(("host", "flavour"), HOSTS)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_revert_restores_every_byte(tmp_path: Path, host: str, flavour: str, newline: str) -> None:
    root = make(tmp_path / "my größtes checkout" / "x", host, flavour, newline)
    (root / "CMakeLists.txt").chmod(0o750)
    before = snapshot(root)
    assert patch(root, "--compat") == 0
    between = snapshot(root)
    assert between != before
    assert between["CMakeLists.txt"][1] == before["CMakeLists.txt"][1]
    for name in (source_name(host), "package.xml"):
        data = between[name][0]
        assert data.count(b"\r\n") == (data.count(b"\n") if newline == "\r\n" else 0)
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before
    assert not (root / ".d2lio-patch").exists()


def test_only_lines_are_inserted(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    before = snapshot(root)
    assert patch(root) == 0
    for name, (data, _) in snapshot(root).items():
        kept = iter(data.splitlines())
        assert all(line in kept for line in before[name][0].splitlines())


def test_second_call_changes_nothing(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    assert patch(root) == 0
    once = snapshot(root)
    times = {p: p.stat().st_mtime_ns for p in root.rglob("*")}
    capsys.readouterr()
    assert patch(root) == 0
    assert "already patched" in capsys.readouterr().out
    assert snapshot(root) == once
    assert {p: p.stat().st_mtime_ns for p in root.rglob("*")} == times
    assert patch(root, "--revert") == 0
    assert patch(root, "--revert") == 0
    assert "not patched" in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--check"], ["--diff"], ["--check", "--revert"]])
def test_looking_touches_nothing(tmp_path: Path, options: list[str]) -> None:
    root = make(tmp_path / "x")
    before = snapshot(root)
    assert patch(root, *options) == 0
    assert snapshot(root) == before
    assert not (root / ".d2lio-patch").exists()


def test_check_lists_every_hook_and_says_why(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    assert patch(root, "--check") == 0
    out = capsys.readouterr().out
    assert "FAST_LIO (ROS 1)" in out
    for name in ("include", "plugin", "accept", "condition", "begin", "end", "build", "package-1"):
        assert f"  {name}: " in out
    assert out.count("why: ") == out.count("test: ") >= 11


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_diff_is_what_git_apply_makes_of_it(tmp_path: Path, newline: str, capfdbinary) -> None:
    root, other = make(tmp_path / "x", newline=newline), make(tmp_path / "y", newline=newline)
    command = [sys.executable, "-I", "-B", REPOSITORY / "patches/tool", "--diff", root]
    diff = subprocess.run(command, check=True, capture_output=True).stdout
    apply = ["git", "apply", "--whitespace=nowarn", "-"]
    environment = {**os.environ, "GIT_CEILING_DIRECTORIES": str(tmp_path)}
    subprocess.run(apply, cwd=other, input=diff, check=True, env=environment)
    assert patch(root) == 0
    assert snapshot(other) == snapshot(root)


def test_compat_can_come_later_and_stays(tmp_path: Path) -> None:
    root = make(tmp_path / "x", "lio_sam")
    before = snapshot(root)
    assert patch(root) == 0
    assert patch(root, "--compat") == 0
    with_compat = snapshot(root)
    assert b"d2lio:begin compat" in with_compat["CMakeLists.txt"][0]
    assert patch(root) == 0
    assert snapshot(root) == with_compat
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


def test_fork_with_moved_and_reformatted_lines(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    text = (root / SOURCE).read_text()
    text = text.replace("p_imu->Process(measures,", "p_imu ->\n        Process ( measures,")
    text = text.replace(
        "(near.empty() || !point_selected_surf[i]) continue;",
        "(near.empty() ||\n! point_selected_surf [i])\n\t\tcontinue;",
    )
    text = text.replace("    solve_time +=", "\tsolve_time/*s*/ +=")
    write(root / SOURCE, "// moved\n" * 500 + text)
    before = snapshot(root)
    assert patch(root) == 0
    patched = (root / SOURCE).read_text()
    assert patched.index("before_prediction") < patched.index("p_imu ->\n")
    assert "\td2lio_plugin.condition(" in patched
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_hook_behind_the_last_line_that_has_no_newline(tmp_path: Path, newline: str) -> None:
    root = make(tmp_path / "x", newline=newline)
    edit(root / "CMakeLists.txt", f"{newline}target_link_libraries(fastlio_mapping m)", "")
    before = snapshot(root)
    assert patch(root) == 0
    assert not (root / "CMakeLists.txt").read_bytes().endswith(b"\n")
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


def test_newer_hook_set_replaces_the_older(tmp_path: Path, monkeypatch) -> None:
    import d2lio_patch.cli as cli
    from d2lio_patch.hooks import load_set

    root = make(tmp_path / "x")
    before = snapshot(root)
    newer = tmp_path / "patches"
    shutil.copytree(REPOSITORY / "patches", newer)
    assert patch(root) == 0
    (newer / "fast_lio/fragments/end.inc").write_text("d2lio_plugin.end_scan(kf, 2);\n")
    monkeypatch.setattr(cli, "load_set", lambda host, name="hooks": load_set(host, name, newer))
    assert patch(root) == 0
    text = (root / SOURCE).read_text()
    assert "end_scan(kf, 2);" in text
    assert "end_scan(kf);" not in text
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


def test_revert_without_our_record(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    before = snapshot(root)
    assert patch(root) == 0
    shutil.rmtree(root / ".d2lio-patch")
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


def test_file_that_was_restored_by_hand_is_patched_again(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    before = (root / SOURCE).read_bytes()
    assert patch(root) == 0
    patched = snapshot(root)
    (root / SOURCE).write_bytes(before)
    assert patch(root) == 0
    assert snapshot(root) == patched


def test_edits_outside_our_lines_survive_a_forced_revert(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    assert patch(root) == 0
    edit(root / SOURCE, "        keep(i);\n", "        keep(i + 1);\n")
    assert patch(root, "--revert", "--force") == 0
    text = (root / SOURCE).read_text()
    assert "keep(i + 1);" in text
    assert "d2lio" not in text


def test_symbolic_links_inside_the_checkout_stay_links(tmp_path: Path) -> None:
    root = make(tmp_path / "real")
    (root / SOURCE).rename(root / "kept.cpp")
    (root / SOURCE).symlink_to("../kept.cpp")
    (tmp_path / "link").symlink_to(root)
    before = snapshot(root)
    assert patch(tmp_path / "link") == 0
    assert (root / SOURCE).is_symlink()
    assert "d2lio_plugin" in (root / "kept.cpp").read_text()
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_git_sees_our_lines_and_nothing_else(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    commit(root)
    assert patch(root) == 0
    status = ["git", "-C", str(root), "status", "--porcelain"]
    seen = subprocess.run(status, check=True, capture_output=True, text=True).stdout.split()
    assert seen == ["M", "CMakeLists.txt", "M", "package.xml", "M", SOURCE]
    assert patch(root, "--revert") == 0
    assert subprocess.run(status, check=True, capture_output=True).stdout == b""
    assert patch(root) == 0  # files that were merely touched are not taken for edited


@pytest.mark.parametrize(
    ("flavour", "marker", "command"),
    [
        ("ros1", ".catkin_tools", "catkin build fast_lio"),
        ("ros1", "src", "catkin_make"),
        ("ros2", "src", "colcon build --packages-select fast_lio"),
    ],
)
def test_next_steps_fit_the_workspace(
    tmp_path: Path, flavour: str, marker: str, command: str, capsys
) -> None:
    workspace = tmp_path / "my ws"
    root = make(workspace / "src/FAST_LIO", flavour=flavour)
    (workspace / marker).mkdir(exist_ok=True)
    assert patch(root) == 0
    out = capsys.readouterr().out
    assert f"cd '{workspace}' && {command}" in out
    assert "mode: point_adaptive" in out
    assert ("ros__parameters:" in out) == (flavour == "ros2")


def test_front_door_needs_no_set_up(door: Door, tmp_path: Path) -> None:
    (door.root / "patches").symlink_to(REPOSITORY / "patches")
    make(tmp_path / "x")
    door.cwd = tmp_path
    done = door.run("patch", "x", D2LIO_PYTHON=sys.executable, PYTHONPATH="/nowhere")
    assert done.returncode == 0, done.stderr
    assert "FAST_LIO (ROS 1): patched" in done.stdout
    assert door.calls() == []


def test_front_door_names_a_python_that_is_too_old(door: Door) -> None:
    done = door.run("patch", "x", FAKE_VERSION="old")
    assert done.returncode == 10
    assert "older than Python 3.8" in done.stderr
