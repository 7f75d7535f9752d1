# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Checkouts to patch: small sources of our own making with the anchors of the real ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from fake_checkout import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "patches/tool"))

HOSTS = [("fast_lio", "ros1"), ("fast_lio", "ros2"), ("lio_sam", "ros1"), ("lio_sam", "ros2")]

_FAST_LIO = """\
// A stand-in; p_imu->Process(x); in a comment is no anchor.
#include "preprocess.h"
{ros_include}

std::unique_ptr<ImuProcess> p_imu = make_process();
const char* note = "if (!point_selected_surf[i]) of a string has no say";

void publish_pose()
{{
    set_posestamp(odomAftMapped, now);
}}

void h_share_model(State& s, Shared& shared)
{{
    for (int i = 0; i < count; i++)
    {{
        near = ikdtree.search(i);
        if (near.empty() || !point_selected_surf[i]) continue;
        keep(i);
    }}
    solve_time += omp_get_wtime() - begin;
}}

#if 0
    p_imu->Process(old);
#endif
void work({node_argument})
{{
    {handle}("mapping{separator}extrinsic_R", extrinR, none());
    p_imu->Process(measures,
                   kf);  /* a comment that
    goes on */
    kf.update_iterated_dyn_share_modified(0.5, time);  /* done,
    really */
    publish_pose();
}}
"""

_LIO_SAM = """\
#include "utility.{header}"
{ros_include}
/* allocateMemory(); transformUpdate(); */

class mapOptimization
{{
public:
    Eigen::Affine3f transPointAssociateToMap;

    mapOptimization()
    {{
        allocateMemory();
    }}

    void allocateMemory()
    {{
    }}

    void handler()
    {{
        updateInitialGuess();
        scan2MapOptimization();
    }}

    void updateInitialGuess()
    {{
    }}

    void corners(int i)
    {{
        kdtreeCornerFromMap->nearestKSearch(p, found, distances);
        float s = weight(fabs(ld2));
        use(s);
    }}

    void surfaces(int i)
    {{
        kdtreeSurfFromMap->nearestKSearch(p, found, distances);
        float s = weight(fabs(pd2),
                         2);
        use(s);
    }}

    bool LMOptimization(int iterCount)
    {{
        cv::solve(matAtA, matAtB, matX);
        if (isDegenerate)
        {{
            matX = matP * old;
        }}
        return true;
    }}

    void scan2MapOptimization()
    {{
        for (int iterCount = 0; iterCount < 30; iterCount++)
        {{
            if (LMOptimization(iterCount))
                break;
        }}
        transformUpdate();
    }}

    void transformUpdate()
    {{
    }}
}};
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.5)
project({package})
add_definitions(-DQUOTE=\\")
# add_executable(old {source})
set(CMAKE_CXX_FLAGS "-std=c++11")
set(CMAKE_CXX_FLAGS_RELEASE "-O3")
add_executable({target} {source}
               src/more.cpp)
target_link_libraries({target} m)"""

_PACKAGE = """\
<?xml version="1.0"?>
<package{format}>
  <name>{package}</name>
  <!-- <buildtool_depend>catkin</buildtool_depend> -->
  <buildtool_depend>{tool}</buildtool_depend>
  <export>
  </export>
</package>
"""


def source_name(host: str) -> str:
    """Path of the file that most hooks go into."""
    return "src/laserMapping.cpp" if host == "fast_lio" else "src/mapOptmization.cpp"


def make(root: Path, host: str = "fast_lio", flavour: str = "ros1", newline: str = "\n") -> Path:
    """Writes a stand-in checkout; CMakeLists.txt has no newline at its end, as upstream's."""
    ros2 = flavour == "ros2"
    words = {
        "ros_include": "#include <rclcpp/rclcpp.hpp>" if ros2 else "#include <ros/ros.h>",
        "header": "hpp" if ros2 else "h",
        "handle": "this->get_parameter_or" if ros2 else "nh.param",
        "separator": "." if ros2 else "/",
        "node_argument": "" if ros2 else "ros::NodeHandle& nh",
        "package": host,
        "source": source_name(host),
        "target": "fastlio_mapping" if host == "fast_lio" else "${PROJECT_NAME}_mapOptmization",
        "format": ' format="3"' if ros2 else "",
        "tool": "ament_cmake" if ros2 else "catkin",
    }
    files = {
        source_name(host): _FAST_LIO if host == "fast_lio" else _LIO_SAM,
        "CMakeLists.txt": _CMAKE,
        "package.xml": _PACKAGE,
    }
    for name, text in files.items():
        write(root / name, text.format(**words).replace("\n", newline))
    if host == "lio_sam":
        header = "include/lio_sam/utility.hpp" if ros2 else "include/utility.h"
        write(root / header, f"#pragma once{newline}int x;{newline}")
    write(root / "README.md", "untouched\n")
    return root


def write(path: Path, text: str) -> None:
    """Writes the bytes of a text, with newlines as they are."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode())


def edit(path: Path, old: str, new: str) -> None:
    """Replaces a text that is there exactly once."""
    text = path.read_bytes().decode()
    assert text.count(old) == 1
    write(path, text.replace(old, new))


def patch(*arguments: str | Path) -> int:
    """Runs the tool in this process; returns the exit code."""
    from d2lio_patch.cli import main

    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as usage:
        return int(usage.code or 0)


def snapshot(root: Path) -> dict[str, tuple[bytes, int]]:
    """Contents and permissions of every file of a checkout, but for git's and our records."""
    return {
        str(path.relative_to(root)): (path.read_bytes(), path.stat().st_mode)
        for path in root.rglob("*")
        if path.is_file() and not {".git", ".d2lio-patch"} & set(path.parts)
    }


def commit(root: Path) -> None:
    """Makes the folder a git repository (if it is none) and commits everything."""
    git = ["git", "-C", str(root), "-c", "user.name=t", "-c", "user.email=t@example.org"]
    for command in (["init", "-q"], ["add", "-A"], ["commit", "-q", "--allow-empty", "-m", "x"]):
        subprocess.run([*git, *command], check=True, capture_output=True)
