# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Every refusal: its exit code, what it names, and that not a byte changes."""

from __future__ import annotations

import fcntl
import os
import shutil
from pathlib import Path

import pytest
from patch_standins import commit, edit, make, patch, snapshot, source_name, write

E_USAGE, E_HOST, E_ANCHOR, E_DIRTY, E_PENDING = 2, 20, 21, 22, 23
SOURCE = source_name("fast_lio")
ACCEPT = "        if (near.empty() || !point_selected_surf[i]) continue;\n"
UPDATE = "    kf.update_iterated_dyn_share_modified(0.5, time);"


def refused(root: Path, code: int, capsys, *options: str) -> str:
    """Runs the tool, checks that it refuses and touches nothing; returns its message."""
    before = snapshot(root) if root.is_dir() else {}
    record = (root / ".d2lio-patch").exists()
    capsys.readouterr()
    assert patch(root, *options) == code
    if root.is_dir():
        assert snapshot(root) == before
        assert (root / ".d2lio-patch").exists() == record
    return capsys.readouterr().err


# --- anchors


def test_absent_anchor(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    edit(root / SOURCE, ACCEPT, "")
    message = refused(root, E_ANCHOR, capsys)
    assert (
        "anchor 'accept' (! point_selected_surf [ i ]) in src/laserMapping.cpp: not found"
        in message
    )


def test_anchor_that_is_there_twice(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    edit(root / SOURCE, ACCEPT, ACCEPT + ACCEPT)
    message = refused(root, E_ANCHOR, capsys)
    assert "anchor 'accept'" in message
    assert "found 2 times (lines 18, 19)" in message


@pytest.mark.parametrize(
    "hidden",
    [
        f"//{ACCEPT}",
        f"/*{ACCEPT}*/\n",
        f"// goes on \\\n{ACCEPT}",
        f"#if 0\n{ACCEPT}#else\n#endif\n",
        f"#if 0\n#ifdef X\n#endif\n{ACCEPT}#endif\n",
        'const char* raw = R"x(if (!point_selected_surf[i]))x";\n',
    ],
)
def test_anchor_in_what_the_compiler_does_not_see_is_none(
    tmp_path: Path, capsys, hidden: str
) -> None:
    root = make(tmp_path / "x")
    edit(root / SOURCE, ACCEPT, hidden)
    assert "not found" in refused(root, E_ANCHOR, capsys)
    edit(root / SOURCE, hidden, hidden + ACCEPT)
    assert patch(root) == 0


def test_all_useless_anchors_are_named_at_once(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    edit(root / SOURCE, ACCEPT, "")
    edit(root / "CMakeLists.txt", "add_executable(fastlio", "old(fastlio")
    message = refused(root, E_ANCHOR, capsys)
    assert "anchor 'accept'" in message
    assert "anchor 'build'" in message
    assert "no file was touched" in message


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (UPDATE, "    if (ready)\n    " + UPDATE, "without braces"),
        (UPDATE, "    if (ready) a();\n    else\n" + UPDATE, "without braces"),
        (UPDATE, UPDATE + " after();", "more code on its line"),
        (UPDATE, "    before();" + UPDATE, "code in front"),
        (UPDATE, "    while (kf.update_iterated_dyn_share_modified(1))\n;", "part of an if, for"),
        (UPDATE, UPDATE.replace(";", " \\\n;"), ""),
        ('#include "preprocess.h"\n', '#ifdef A\n#include "preprocess.h"\n#endif\n', "inside #if"),
        (ACCEPT, "#pragma omp simd\n" + ACCEPT, "#pragma"),
    ],
)
def test_place_where_a_line_would_change_the_meaning(
    tmp_path: Path, capsys, old: str, new: str, reason: str
) -> None:
    root = make(tmp_path / "x")
    edit(root / SOURCE, old, new)
    if reason:
        assert reason in refused(root, E_ANCHOR, capsys)
    else:
        assert patch(root) == 0


def test_package_file_that_would_break(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    text = (root / "package.xml").read_text()
    write(
        root / "package.xml",
        text.replace("\n  <export>", "").replace("</export>\n", "</export>").replace("\n", " "),
    )
    message = refused(root, E_ANCHOR, capsys)
    assert "package.xml" in message


def test_missing_file(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    (root / "CMakeLists.txt").unlink()
    assert "anchor 'build': CMakeLists.txt is not there" in refused(root, E_ANCHOR, capsys)


# --- not a checkout, or of something else


def test_not_a_checkout(tmp_path: Path, capsys) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "empty").mkdir()
    assert "absent" in refused(tmp_path / "nothing", E_HOST, capsys)
    assert "not a folder" in refused(tmp_path / "file", E_HOST, capsys)
    assert "no package.xml" in refused(tmp_path / "empty", E_HOST, capsys)


def test_workspace_in_place_of_the_checkout(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "ws/src/FAST_LIO")
    assert f"did you mean {root} ?" in refused(tmp_path / "ws", E_HOST, capsys)


def test_another_package(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    edit(root / "package.xml", "<name>fast_lio<", "<name>other<")
    edit(root / SOURCE, "void h_share_model", "void observe")
    assert "package 'other' is neither FAST_LIO nor LIO-SAM" in refused(root, E_HOST, capsys)


def test_branches_mixed_up(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x", flavour="ros1")
    edit(root / SOURCE, "#include <ros/ros.h>", "#include <rclcpp/rclcpp.hpp>")
    assert "package.xml is for catkin" in refused(root, E_HOST, capsys)
    edit(
        root / "package.xml",
        "catkin</buildtool_depend>\n  <export>",
        "qmake</buildtool_depend>\n  <export>",
    )
    assert "neither catkin nor ament_cmake" in refused(root, E_HOST, capsys)


def test_file_that_is_a_link_out_of_the_checkout(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    (root / SOURCE).rename(tmp_path / "shared.cpp")
    (root / SOURCE).symlink_to(tmp_path / "shared.cpp")
    assert "symbolic link out of the checkout" in refused(root, E_HOST, capsys, "--force")


def test_record_folder_that_is_a_link(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    (tmp_path / "elsewhere").mkdir()
    (root / ".d2lio-patch").symlink_to(tmp_path / "elsewhere")
    assert "symbolic link" in refused(root, E_PENDING, capsys)
    assert list((tmp_path / "elsewhere").iterdir()) == []


# --- what the user has at work


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_uncommitted_changes(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "outer repository/src/x")
    commit(tmp_path / "outer repository")
    edit(root / SOURCE, "        keep(i);\n", "        keep(i + 1);\n")
    before = snapshot(root)
    message = refused(root, E_DIRTY, capsys)
    assert f"{SOURCE}: has changes that are not committed" in message
    assert "CMakeLists" not in message
    refused(root, E_DIRTY, capsys, "--check")
    assert patch(root, "--force") == 0
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_changes_in_other_files_do_not_matter(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    commit(root)
    (root / "README.md").write_text("edited\n")
    assert patch(root) == 0


@pytest.mark.parametrize("in_git", [False, True])
def test_patched_file_that_was_edited_since(tmp_path: Path, capsys, in_git: bool) -> None:
    root = make(tmp_path / "x")
    if in_git:
        commit(root)
    assert patch(root) == 0
    edit(root / SOURCE, "        keep(i);\n", "        keep(i + 1);\n")
    message = refused(root, E_DIRTY, capsys, "--revert")
    assert SOURCE in message
    assert "package.xml" not in message


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_patch_that_was_committed_can_be_reverted(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    commit(root)
    before = snapshot(root)
    assert patch(root) == 0
    commit(root)
    shutil.rmtree(root / ".d2lio-patch")
    assert patch(root, "--revert") == 0
    assert snapshot(root) == before


def test_read_only_file(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    (root / SOURCE).chmod(0o444)
    before = snapshot(root)
    assert f"{SOURCE}: is read-only" in refused(root, E_DIRTY, capsys)
    assert patch(root, "--force") == 0
    assert (root / SOURCE).stat().st_mode & 0o777 == 0o444
    assert patch(root, "--revert", "--force") == 0
    assert snapshot(root) == before


@pytest.mark.parametrize("marker", ["// d2lio:begin end\n", "// d2lio:end end\n"])
def test_marker_line_that_was_removed(tmp_path: Path, capsys, marker: str) -> None:
    root = make(tmp_path / "x")
    assert patch(root) == 0
    edit(root / SOURCE, f"    {marker}", "")
    for options in (["--revert", "--force"], ["--force"]):
        message = refused(root, E_DIRTY, capsys, *options)
        assert SOURCE in message
        assert "were edited" in message


def test_another_call_at_work(tmp_path: Path, capsys) -> None:
    root = make(tmp_path / "x")
    handle = os.open(root, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        assert "another call is at work" in refused(root, E_PENDING, capsys)
    finally:
        os.close(handle)


@pytest.mark.parametrize(
    "options", [[], ["--nonsense"], ["--check", "--diff"], ["--revert", "--compat"]]
)
def test_usage(tmp_path: Path, capsys, options: list[str]) -> None:
    root = make(tmp_path / "x")
    before = snapshot(root)
    assert patch(*options, *([root] if options else [])) == E_USAGE
    assert snapshot(root) == before
