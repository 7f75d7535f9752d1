# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The hook sets: short anchors, short fragments, and every hook in its place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from fake_checkout import REPOSITORY
from patch_standins import HOSTS, make, patch, source_name

MAX_FRAGMENT_LINES = 8
MAX_ANCHOR_IDENTIFIERS = 4


def all_hooks() -> list:
    from d2lio_patch.hooks import load_set

    sets = [load_set(h, n) for h in ("fast_lio", "lio_sam") for n in ("hooks", "compat")]
    return [hook for s in sets if s for hook in s.hooks]


def patched(tmp_path: Path, host: str, flavour: str, *options: str) -> Path:
    root = make(tmp_path / "x", host, flavour)
    assert patch(root, *options) == 0
    return root


def lines_around(text: str, name: str) -> tuple[str, str]:
    """The lines of code before and after a block."""
    before, _, rest = text.partition(f"d2lio:begin {name}\n")
    after = rest.partition(f"d2lio:end {name}\n")[2]
    assert after, f"no block {name}"

    def code(lines: list[str]) -> str:
        return next(line.strip() for line in lines if "d2lio:" not in line and line.strip())

    return code(before.splitlines()[:-1][::-1]), code(after.splitlines())


@pytest.mark.parametrize("hook", all_hooks(), ids=lambda hook: hook.name)
def test_hook_is_short_and_explained(hook) -> None:
    for anchor in hook.anchors:
        tokens = [re.sub(r"^<.*>$|\|.*", "", token) for token in anchor.split()]
        words = re.findall(r"[A-Za-z_]\w*", " ".join(tokens))
        assert 1 <= len(words) <= MAX_ANCHOR_IDENTIFIERS
    for fragment in hook.fragments.values():
        assert 1 <= len(fragment.splitlines()) <= MAX_FRAGMENT_LINES
        assert fragment.isascii()
        assert fragment.endswith("\n")
    assert hook.what
    assert hook.why
    assert (REPOSITORY / hook.test).exists()


def test_fragments_that_no_hook_uses_are_gone() -> None:
    for host in ("fast_lio", "lio_sam"):
        sets = "".join(p.read_text() for p in (REPOSITORY / "patches" / host).glob("*.ini"))
        for fragment in (REPOSITORY / "patches" / host / "fragments").iterdir():
            assert re.search(rf"^fragment.* = {re.escape(fragment.name)}$", sets, re.MULTILINE)


@pytest.mark.parametrize("flavour", ["ros1", "ros2"])
def test_fast_lio_hooks_are_in_their_places(tmp_path: Path, flavour: str) -> None:
    text = (patched(tmp_path, "fast_lio", flavour) / source_name("fast_lio")).read_text()
    assert "extrinsic_R" in lines_around(text, "configure")[0]
    assert lines_around(text, "include")[0] == '#include "preprocess.h"'
    assert lines_around(text, "plugin")[0].startswith("std::unique_ptr<ImuProcess> p_imu")
    assert lines_around(text, "covariance") == ("set_posestamp(odomAftMapped, now);", "}")
    assert (
        lines_around(text, "accept")[1] == "if (near.empty() || !point_selected_surf[i]) continue;"
    )
    assert lines_around(text, "condition")[1].startswith("solve_time +=")
    assert lines_around(text, "previous")[1].startswith("p_imu->Process(measures")
    assert lines_around(text, "begin")[1].startswith("kf.update_iterated")
    assert lines_around(text, "end") == ("really */", "publish_pose();")
    node = "nh" if flavour == "ros1" else "*this"
    assert f"d2lio_plugin.configure({node}, filter_size_map_min);" in text


@pytest.mark.parametrize("flavour", ["ros1", "ros2"])
def test_lio_sam_hooks_are_in_their_places(tmp_path: Path, flavour: str) -> None:
    text = (patched(tmp_path, "lio_sam", flavour) / source_name("lio_sam")).read_text()
    assert lines_around(text, "include")[0].startswith('#include "utility.h')
    assert lines_around(text, "plugin")[0].endswith("transPointAssociateToMap;")
    assert lines_around(text, "configure") == ("allocateMemory();", "}")
    assert lines_around(text, "previous")[1] == "updateInitialGuess();"
    assert lines_around(text, "corner-gate")[0].startswith("kdtreeCornerFromMap->")
    assert lines_around(text, "corner-weight") == ("float s = weight(fabs(ld2));", "use(s);")
    assert lines_around(text, "surface-gate")[0].startswith("kdtreeSurfFromMap->")
    assert lines_around(text, "surface-weight") == ("2);", "use(s);")
    assert lines_around(text, "condition")[1].startswith("cv::solve")
    assert lines_around(text, "restore")[0].startswith("cv::solve")
    assert lines_around(text, "step") == ("matX = matP * old;", "}")
    assert lines_around(text, "begin")[1].startswith("for (int iterCount")
    assert lines_around(text, "end") == ("transformUpdate();", "}")


@pytest.mark.parametrize(("host", "flavour"), HOSTS)
def test_build_files_find_the_library(tmp_path: Path, host: str, flavour: str) -> None:
    root = patched(tmp_path, host, flavour)
    cmake = (root / "CMakeLists.txt").read_text()
    assert f"set(D2LIO_CHECKOUT [==[{REPOSITORY}]==])" in cmake
    target = (
        "fastlio_mapping fastlio" if host == "fast_lio" else "${PROJECT_NAME}_mapOptmization liosam"
    )
    assert f"d2lio_upstream({target})" in cmake
    assert lines_around(cmake, "build") == ("src/more.cpp)", cmake.splitlines()[-1])
    package = (root / "package.xml").read_text()
    assert ("<run_depend>diagnostic_msgs<" in package) == (flavour == "ros1")
    assert ("<depend>diagnostic_msgs<" in package) == (flavour == "ros2")


def test_package_format_2_of_a_ros_1_fork(tmp_path: Path) -> None:
    root = make(tmp_path / "x")
    text = (root / "package.xml").read_text()
    (root / "package.xml").write_text(text.replace("<package>", "<package format='2'>"))
    assert patch(root) == 0
    assert "run_depend" not in (root / "package.xml").read_text()


def test_compat_fixes_come_with_lio_sam_on_ros_1_when_asked_for(tmp_path: Path) -> None:
    root = patched(tmp_path, "lio_sam", "ros1", "--compat")
    cmake = (root / "CMakeLists.txt").read_text()
    assert lines_around(cmake, "compat")[0] == 'set(CMAKE_CXX_FLAGS "-std=c++11")'
    assert lines_around((root / "include/utility.h").read_text(), "compat-flann")[1] == "int x;"
    assert (
        "d2lio:begin compat"
        not in (patched(tmp_path / "2", "lio_sam", "ros1") / "CMakeLists.txt").read_text()
    )


@pytest.mark.parametrize(("host", "flavour"), [("fast_lio", "ros1"), ("lio_sam", "ros2")])
def test_compat_is_named_as_needless_elsewhere(
    tmp_path: Path, host: str, flavour: str, capsys
) -> None:
    patched(tmp_path, host, flavour, "--compat")
    assert "needs no compile fix" in capsys.readouterr().err


def test_adapters_include_only_what_upstream_cmake_builds() -> None:
    cmake = (REPOSITORY / "patches/cmake/upstream.cmake").read_text()
    modules = re.search(r"set\(D2LIO_UPSTREAM_MODULES ([a-z ]+)\)", cmake)[1].split()
    common = REPOSITORY / "common"
    folders = [common / "src" / m for m in modules] + [
        common / "include/d2lio" / m for m in modules
    ]
    folders += [REPOSITORY / f"{host}_plugin/adapter" for host in ("fastlio", "liosam")]
    files = [p for folder in folders for p in folder.rglob("*.[ch]pp")]
    assert len(files) > len(modules)
    for path in files:
        for module in re.findall(r'#include "d2lio/(\w+)/', path.read_text()):
            assert module in [*modules, "fastlio", "liosam"], path
