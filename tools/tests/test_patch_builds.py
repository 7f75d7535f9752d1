# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A patched checkout builds by the inserted lines alone, and runs: stand-ins of patch_builds/.

The ROS 1 checkouts find this repository where the patch left it, the ROS 2 ones by
-DD2LIO_CHECKOUT through a link, as if it had moved. All paths have a space and an umlaut.
"""

from __future__ import annotations

import csv
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from fake_checkout import REPOSITORY
from patch_standins import HOSTS, edit, snapshot, source_name

SOURCES = Path(__file__).parent / "patch_builds"
FAKE_ROS = REPOSITORY / "common/tests/ros"
SCANS = 15  # matched ones: the first makes the map
TIME_LIMIT_S = 900

# What a port to ROS 2 changes in the source.
ROS2_EDITS = {
    "fast_lio": [
        ("#include <ros/ros.h>\n", "#include <rclcpp/rclcpp.hpp>\n"),
        ("class LaserMapping {", "class LaserMapping : public standin::Node {"),
        (": nh(argc, argv) {", ": standin::Node(argc, argv) {"),
        ('nh.param("mapping/', 'this->get_parameter_or("mapping.'),
        ("    standin::Node nh;\n", ""),
    ],
    "lio_sam": [
        ("#include <ros/ros.h>\n", "#include <rclcpp/rclcpp.hpp>\n"),
        ('#include "utility.h"\n', '#include "lio_sam/utility.hpp"\n'),
    ],
}

# Against the truth of a 1.5 m walk in an 8 m x 6 m room with 5 mm range noise; the odometry alone,
# which is right to 15 mm and 4 mrad a step, is not held to it.
NEAR_TRUTH_M = 0.15
# The host's gates decide in both, but each side fits its own planes, in another order of sums: that
# is 1e-7 m, or some 1e-4 m if one of 250 points at a gate's edge falls to the other side.
SAME_GATES_M = 5e-4


def run(*command: str | Path, **options) -> subprocess.CompletedProcess[str]:
    """A command with its output; a failure shows it."""
    done = subprocess.run(
        [str(word) for word in command],
        encoding="utf-8",
        capture_output=True,
        timeout=TIME_LIMIT_S,
        check=False,
        **options,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-6000:]}\n{done.stderr[-6000:]}"
    return done


def start(program: Path, *parameters: str) -> subprocess.CompletedProcess[str]:
    """The program with parameters under d2lio/; threads that wait do not spin."""
    environment = os.environ | {"OMP_NUM_THREADS": "2", "OMP_WAIT_POLICY": "passive"}
    return subprocess.run(
        [program, *(f"d2lio/{p}" for p in parameters)],
        encoding="utf-8",
        capture_output=True,
        timeout=TIME_LIMIT_S,
        check=False,
        env=environment,
    )


def output(program: Path, *parameters: str) -> str:
    """What the program prints: a pose a line."""
    done = start(program, *parameters)
    assert done.returncode == 0, done.stderr
    return done.stdout


def poses(text: str) -> list[list[float]]:
    """Stamp, position, and the rest, of each scan; all finite."""
    rows = [[float(word) for word in line.split()] for line in text.splitlines()]
    assert len(rows) == SCANS
    assert all(math.isfinite(value) for row in rows for value in row)
    return rows


def apart(a: str, b: str) -> float:
    """Largest distance of two trajectories, m."""
    return max(math.dist(p[1:4], q[1:4]) for p, q in zip(poses(a), poses(b), strict=True))


def off_truth(text: str) -> float:
    """Largest distance from the truth, standin/room.h, m."""

    def truth(t: float) -> tuple[float, float, float]:
        return 1.5 * math.sin(0.8 * t), math.sin(1.1 * t), 0.2 * math.sin(0.5 * t)

    return max(math.dist(p[1:4], truth(p[0])) for p in poses(text))


def choices(key: str) -> list[str]:
    """What a parameter may be, by the documentation."""
    text = (REPOSITORY / "docs/PARAMETERS.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| `{re.escape(key)}` \| choice \| [^|]* \| ([^|]*) \|", text, re.M)
    assert row is not None
    return [word.strip() for word in row[1].split(",")]


def install_ros(prefix: Path, flavour: str) -> None:
    """Lays out the stand-in of a ROS distribution."""
    shutil.copytree(SOURCES / flavour, prefix)
    shutil.copytree(SOURCES / "include", prefix / "include", dirs_exist_ok=True)
    for folder in (FAKE_ROS / flavour).iterdir():
        home = "messages" if folder.name == "diagnostic_msgs" else "include"
        (prefix / home).mkdir(exist_ok=True)
        (prefix / home / folder.name).symlink_to(folder)


def make_checkout(root: Path, host: str, flavour: str) -> None:
    for part in ("common", flavour):
        shutil.copytree(SOURCES / host / part, root, dirs_exist_ok=True)
    if flavour == "ros2":
        for old, new in ROS2_EDITS[host]:
            edit(root / source_name(host), old, new)


@dataclass
class Checkout:
    """A stand-in host, and what became of it on the way."""

    root: Path
    host: str
    flavour: str
    distribution: Path
    moved_to: Path
    unpatched: str = ""
    reverted: str = ""
    original: dict = field(default_factory=dict)
    program: Path = Path()
    commands: str = ""  # of the patched build
    commands_after: str = ""  # of the reverted one

    @property
    def build_folder(self) -> Path:
        return self.root.parent.parent / "build"

    def patch(self, *options: str) -> None:
        environment = os.environ | {"D2LIO_PYTHON": sys.executable}
        run(REPOSITORY / "d2lio", "patch", self.root, *options, env=environment)

    def build(self) -> Path:
        """Builds as upstream is built."""
        options = [
            f"-DCMAKE_PREFIX_PATH={self.distribution}",
            "-DCMAKE_BUILD_TYPE=Release",
            "-DCMAKE_CXX_FLAGS_RELEASE=-O1",
        ]
        if self.flavour == "ros2":
            options.append(f"-DD2LIO_CHECKOUT={self.moved_to}")
        if (self.host, self.flavour) != HOSTS[0]:
            # Halves the time. Sources that cannot be joined show here, but not in HOSTS[0].
            options.append("-DCMAKE_UNITY_BUILD=ON")
        run("cmake", "-S", self.root, "-B", self.build_folder, "-G", "Ninja", *options)
        run("cmake", "--build", self.build_folder, "-j", "1")
        name = "fastlio_mapping" if self.host == "fast_lio" else "lio_sam_map*"
        (program,) = self.build_folder.glob(name)
        return program

    def build_commands(self) -> str:
        """What Ninja runs, without the quoting of spaces."""
        done = run("ninja", "-C", self.build_folder, "-t", "commands")
        return done.stdout.replace("\\ ", " ")


def prepare(base: Path, host: str, flavour: str) -> Checkout:
    """A checkout that was built in one folder as it is, patched, and reverted."""
    workspace, distribution, moved = base / "my wörkspace", base / flavour, base / "moved d²lio"
    install_ros(distribution, flavour)
    moved.symlink_to(REPOSITORY)
    made = Checkout(workspace / "src" / host, host, flavour, distribution, moved)
    make_checkout(made.root, host, flavour)
    made.original = snapshot(made.root)
    made.unpatched = output(made.build())
    made.patch()
    made.program = workspace / "patched"
    shutil.copy2(made.build(), made.program)
    made.commands = made.build_commands()
    made.patch("--revert")
    made.reverted = output(made.build())
    made.commands_after = made.build_commands()
    return made


@pytest.fixture(scope="session")
def preparations(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[tuple[str, str], Future[Checkout]]]:
    """All checkouts that the chosen tests need, two at a time."""
    specs = [getattr(item, "callspec", None) for item in request.session.items]
    wanted = {spec.params["checkout"] for spec in specs if spec and "checkout" in spec.params}
    with ThreadPoolExecutor(max_workers=min(2, os.cpu_count() or 1)) as pool:
        yield {
            host: pool.submit(prepare, tmp_path_factory.mktemp("_".join(host)), *host)
            for host in HOSTS
            if host in wanted
        }


@pytest.fixture(scope="session", params=HOSTS, ids="-".join)
def checkout(
    request: pytest.FixtureRequest, preparations: dict[tuple[str, str], Future[Checkout]]
) -> Checkout:
    return preparations[request.param].result()


def test_the_stand_in_is_an_odometry(checkout: Checkout) -> None:
    assert off_truth(checkout.unpatched) < NEAR_TRUTH_M


def test_patched_without_parameters_is_the_same_byte_for_byte(checkout: Checkout) -> None:
    done = start(checkout.program)
    assert (done.returncode, done.stdout) == (0, checkout.unpatched)
    assert done.stderr == ""  # no topic either


@pytest.mark.parametrize("method", choices("degeneracy.method"))
@pytest.mark.parametrize("mode", choices("rejection.mode"))
def test_every_mode_and_method_runs(
    checkout: Checkout, tmp_path: Path, mode: str, method: str
) -> None:
    record = tmp_path / "record.csv"
    if method in ("xicp", "noise_aware") and checkout.host == "lio_sam":  # it shows no rows
        refused = start(checkout.program, f"rejection/mode={mode}", f"degeneracy/method={method}")
        assert refused.returncode != 0
        assert f"{method}: not inside LIO-SAM" in refused.stderr
        return
    printed = output(
        checkout.program,
        f"rejection/mode={mode}",
        f"degeneracy/method={method}",
        f"diagnostics/csv={record}",
    )
    assert off_truth(printed) < NEAR_TRUTH_M
    if method not in ("tsvd", "xicp"):  # which act where a direction is weak: none need be here
        assert (printed == checkout.unpatched) == (mode == "off" and method == "none")
    rows = list(csv.DictReader(record.open(encoding="utf-8")))
    stamps = [float(row["stamp"]) for row in rows]
    assert stamps == pytest.approx([pose[0] for pose in poses(printed)], abs=1e-8)
    assert all(0 < float(row["accepted"]) <= float(row["offered"]) for row in rows)


def test_fixed_with_the_hosts_gates_and_no_limit_is_off(checkout: Checkout) -> None:
    fixed = ("rejection/mode=fixed", "rejection/tau=1e5")
    kept = output(checkout.program, *fixed, "rejection/keep_host_gate=true")
    assert apart(kept, checkout.unpatched) < SAME_GATES_M
    assert apart(output(checkout.program, *fixed), checkout.unpatched) > 10 * SAME_GATES_M


def test_a_wrong_key_or_value_stops_the_program_at_start(checkout: Checkout) -> None:
    done = start(checkout.program, "rejection/mode=kis", "degeneracy/w=-1", "rejection/tua=2")
    assert done.returncode != 0
    assert done.stdout == ""
    modes = ", ".join(choices("rejection.mode"))
    assert f"d2lio/rejection/mode = kis: allowed: one of {modes}" in done.stderr
    assert "d2lio/degeneracy/w = -1: allowed: " in done.stderr
    assert "d2lio/rejection/tua = 2: unknown; there are d2lio/rejection/mode " in done.stderr


def test_diagnostics_go_to_a_topic(checkout: Checkout) -> None:
    assert start(checkout.program, "degeneracy/method=paper").stderr == (
        "advertised d2lio/diagnostics\n"
    )
    asked = start(checkout.program, "diagnostics/topic=health")
    assert (asked.stdout, asked.stderr) == (checkout.unpatched, "advertised health\n")


def test_upstream_fixes_fill_the_covariance_and_move_nothing(checkout: Checkout) -> None:
    if checkout.host == "lio_sam":
        done = start(checkout.program, "upstream_fixes=true")
        assert "d2lio/upstream_fixes = true: unknown" in done.stderr
        return
    fixed, before = (
        poses(output(checkout.program, "upstream_fixes=true")),
        poses(checkout.unpatched),
    )
    assert [row[:8] for row in fixed] == [row[:8] for row in before]
    assert all(row[8] > 0.0 and row[9] > 0.0 for row in fixed)
    assert all(row[8:] == [0.0, 0.0] for row in before)


def test_the_library_comes_from_where_the_user_says(checkout: Checkout) -> None:
    """A patched checkout names this repository; -DD2LIO_CHECKOUT outweighs that."""
    includes = "{}/common/include"
    moved = checkout.flavour == "ros2"
    assert (includes.format(checkout.moved_to) in checkout.commands) == moved
    assert (includes.format(REPOSITORY) in checkout.commands) != moved


def test_reverted_it_builds_and_prints_as_before(checkout: Checkout) -> None:
    assert snapshot(checkout.root) == checkout.original
    assert checkout.reverted == checkout.unpatched
    assert "d2lio_upstream" in checkout.commands
    assert "d2lio_upstream" not in checkout.commands_after


@pytest.mark.parametrize(
    ("settings", "standard"),
    [
        ('set(CMAKE_CXX_FLAGS "-std=c++11 -march=native")', "-std=c++14"),
        ('set(CMAKE_CXX_FLAGS "-std=gnu++0x -O2")', "-std=c++14"),
        ("add_compile_options(-std=c++11)", "-std=c++14"),
        ("set(CMAKE_CXX_STANDARD 11)", "-std=gnu++14"),
        ('set(CMAKE_CXX_FLAGS "-std=c++11")\nset(CMAKE_CXX_STANDARD 17)', "-std=gnu++17"),
        ('set(CMAKE_CXX_FLAGS "-std=c++17")', "-std=c++17"),
        ("add_compile_options(-std=c++20)", "-std=c++20"),
    ],
)
def test_the_glue_gets_a_standard_it_compiles_with(
    tmp_path: Path, settings: str, standard: str
) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.5)\nproject(x CXX)\n{settings}\n"
        "add_executable(node node.cpp)\n"
        f'include("{REPOSITORY}/patches/cmake/upstream.cmake")\nd2lio_upstream(node fastlio)\n',
        encoding="utf-8",
    )
    (tmp_path / "node.cpp").write_text("int main() {}\n", encoding="utf-8")
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja")
    commands = run("ninja", "-C", tmp_path / "b", "-t", "commands").stdout.splitlines()
    (compile_node,) = (line for line in commands if line.endswith("/node.cpp"))
    assert re.findall(r"-std=\S+", compile_node)[-1] == standard
