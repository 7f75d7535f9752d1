# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""find_package(GTSAM): whole installations, Debian's faulty one, none, and another version."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from fake_checkout import REPOSITORY

PROJECT = """
cmake_minimum_required(VERSION 3.22)
project(find LANGUAGES CXX)
list(APPEND CMAKE_MODULE_PATH "${CMAKE_SOURCE_DIR}/dependencies" "${MODULES}")
foreach(place CMAKE_ENVIRONMENT SYSTEM_ENVIRONMENT CMAKE_SYSTEM)
  set(CMAKE_FIND_USE_${place}_PATH OFF) # not this machine's GTSAM
endforeach()
find_package(GTSAM 4.2 QUIET)
if(TARGET gtsam)
  get_target_property(includes gtsam INTERFACE_INCLUDE_DIRECTORIES)
endif()
message("FOUND=${GTSAM_FOUND} INCLUDES=${includes}")
"""
VERSION = """
set(PACKAGE_VERSION "{version}")
if(NOT PACKAGE_VERSION VERSION_LESS PACKAGE_FIND_VERSION)
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
endif()
"""
EXPORTS = """
set(prefix "${CMAKE_CURRENT_LIST_DIR}/../../..")
add_library(gtsam UNKNOWN IMPORTED)
set_target_properties(gtsam PROPERTIES INTERFACE_INCLUDE_DIRECTORIES /from/its/own/config)
include("${CMAKE_CURRENT_LIST_DIR}/GTSAM-exports-release.cmake")
"""
WITH_TEST_LIBRARY = """
set(IMPORTED_LOCATION_RELEASE "${prefix}/lib/libCppUnitLite.a")
if(NOT EXISTS "${IMPORTED_LOCATION_RELEASE}")
  message(FATAL_ERROR "references a file that does not exist")
endif()
"""


def install(prefix: Path, version: str, details: str) -> None:
    """A GTSAM as its own build would install it, with these contents of the second exports file."""
    config = prefix / "lib/cmake/GTSAM"
    config.mkdir(parents=True)
    (prefix / "include/gtsam").mkdir(parents=True)
    (prefix / "lib/libgtsam.so").write_text("")
    (config / "GTSAMConfig.cmake").write_text(
        'include("${CMAKE_CURRENT_LIST_DIR}/GTSAM-exports.cmake")\n'
    )
    (config / "GTSAMConfigVersion.cmake").write_text(VERSION.format(version=version))
    (config / "GTSAM-exports.cmake").write_text(EXPORTS)
    (config / "GTSAM-exports-release.cmake").write_text(details)


def find(folder: Path, prefix: Path) -> str:
    """What a project that asks for GTSAM 4.2 is told; its dependencies are taken as found."""
    (folder / "dependencies").mkdir()
    for name in ("Boost", "Eigen3", "TBB"):
        (folder / f"dependencies/Find{name}.cmake").write_text(f"set({name}_FOUND TRUE)\n")
    (folder / "CMakeLists.txt").write_text(PROJECT)
    command = ["cmake", "-G", "Ninja", "-S", folder, "-B", folder / "build"]
    command += [f"-DMODULES={REPOSITORY / 'cmake'}", f"-DCMAKE_PREFIX_PATH={prefix}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return next(line for line in done.stderr.splitlines() if line.startswith("FOUND="))


@pytest.mark.parametrize("details", ["", WITH_TEST_LIBRARY], ids=["plain", "with CppUnitLite"])
def test_whole_installation_is_loaded_as_it_is(tmp_path: Path, details: str) -> None:
    prefix = tmp_path / "a prefix"
    install(prefix, "4.2.0", details)
    (prefix / "lib/libCppUnitLite.a").write_text("")
    assert find(tmp_path, prefix) in (
        f"FOUND={found} INCLUDES=/from/its/own/config" for found in ("1", "TRUE")
    )


def test_debians_package_without_cppunitlite_is_usable(tmp_path: Path) -> None:
    prefix = tmp_path / "a prefix"
    install(prefix, "4.2.0", WITH_TEST_LIBRARY)
    assert find(tmp_path, prefix) == f"FOUND=TRUE INCLUDES={prefix}/include"


@pytest.mark.parametrize("details", ["", WITH_TEST_LIBRARY], ids=["plain", "faulty"])
def test_older_version_is_not_taken(tmp_path: Path, details: str) -> None:
    install(tmp_path / "prefix", "4.0.3", details)
    assert "FOUND=FALSE" in find(tmp_path, tmp_path / "prefix")


def test_none_is_told_by_the_variable_alone(tmp_path: Path) -> None:
    assert find(tmp_path, tmp_path / "nowhere") == "FOUND=FALSE INCLUDES="
