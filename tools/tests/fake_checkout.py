# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A checkout with the real front door in it, and a PATH on which every tool that acts is a fake."""

from __future__ import annotations

import shutil
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
TIME_LIMIT_S = 20

# What the front door may take for granted on a bare Debian.
REAL_TOOLS = [
    "awk",
    "basename",
    "bash",
    "cat",
    "cut",
    "df",
    "dirname",
    "env",
    "find",
    "flock",
    "grep",
    "id",
    "mkdir",
    "mv",
    "nproc",
    "printf",
    "readlink",
    "rm",
    "sed",
    "setsid",
    "sha256sum",
    "sh",
    "sleep",
    "sort",
    "tail",
    "touch",
    "tee",
    "true",
    "uname",
    "wc",
    "xargs",
]

# Each fake writes its call to $CALLS; FAKE_* variables choose how it ends.
FAKES = {
    "apt-get": """
        case "$*" in
            *indextargets*) [ -z "${FAKE_NO_LISTS:-}" ] || [ -e "$CALLS.lists" ] || exit 0
                            echo 'MetaKey: main/binary-amd64/Packages'; exit 0 ;;
            *update*) touch "$CALLS.lists"; exit "${FAKE_UPDATE:-0}" ;;
            *' source '*)
                [ "${FAKE_SOURCE:-ok}" = ok ] || { echo 'E: Unable to find a source'; exit 100; }
                echo tarball >gtsam_4.2.0+dfsg.orig.tar.xz; exit 0 ;;
            *install*) ;;
            *) exit 0 ;;
        esac
        if [ "${FAKE_APT:-ok}" != ok ]; then
            echo 'E: Failed to fetch libtbb-dev  Could not connect'; exit 100
        fi
        for word; do echo "$word"; done >>"$INSTALLED"
    """,
    "apt-cache": """
        [ -z "${FAKE_NO_LISTS:-}" ] || [ -e "$CALLS.lists" ] || exit 0
        printf 'libgtsam-dev:\\n  Installed: (none)\\n  Candidate: %s\\n' "$FAKE_CANDIDATE"
    """,
    "apt-config": """
        printf "list='%s'\\nparts='%s/'\\n" "$APT_ETC/sources.list" "$APT_ETC/sources.list.d"
    """,
    "dpkg": "exit 0",
    "dpkg-query": """
        status=0
        for word; do # as the real one: fails when a package is unknown
            case "$word" in -*|*Package*|*Status*) continue ;; esac
            if grep -qx -- "$word" "$INSTALLED"; then
                printf '%s ii 4.2.0+dfsg-1\\n' "$word"
            else
                status=1
            fi
        done
        exit $status
    """,
    "sudo": """
        [ "${FAKE_SUDO:-ok}" = ok ] || exit 1
        [ "$1" = -n ] && shift
        exec "$@"
    """,
    "c++": "exit 0",
    "ninja": "exit 0",
    "patch": "exit 0",
    "tar": "exit 0",
    "cmake": """
        case "$*" in
            '--build build '*) # of GTSAM
                case "${FAKE_GTSAM:-ok}" in
                    ok) ;;
                    hang) touch build/first.o; echo $$ >"$PIP_PID"; exec sleep 60 ;;
                    full) echo 'fatal error: error writing: No space left on device'; exit 1 ;;
                    *) echo 'Pose3.cpp:7:1: error: expected ;'; exit 1 ;;
                esac ;;
            *' -DCMAKE_INSTALL_PREFIX='*) mkdir -p build ;;
            '--install build')
                mkdir -p prefix/lib/cmake/GTSAM; touch prefix/lib/cmake/GTSAM/GTSAMConfig.cmake ;;
            *) echo "CMAKE_PREFIX_PATH $CMAKE_PREFIX_PATH" >>"$CALLS" ;;
        esac
        if [ "${FAKE_BUILD:-ok}" != ok ]; then
            echo 'so3.cpp:12:3: error: expected ;'; echo 'ninja: build stopped'; exit 1
        fi
    """,
    "ctest": """
        while [ $# -gt 0 ]; do [ "$1" = --output-junit ] && junit=$2; shift; done
        gtest=${GTEST_OUTPUT#xml:}
        printf '%s' "$FAKE_CTEST" >"$junit"
        [ -z "$FAKE_GTEST" ] || printf '%s' "$FAKE_GTEST" >"$gtest/test_geometry.xml"
        exit "${FAKE_CTEST_STATUS:-0}"
    """,
    # Stands for /usr/bin/python3 and, copied by `-m venv`, for the environment's own.
    "python3": """
        here=${0%/*}
        case "$*" in
            *sys.version_info*) [ "${FAKE_VERSION:-new}" = new ] ;;
            *sys.version*) echo '3.11.2 (fake)' ;;
            *requirements.py\\ --missing*) [ -e "$here/packages" ] || echo 'numpy>=1.26' ;;
            *requirements.py*|*summary.py*) exec "$REAL_PYTHON" "$@" ;;
            *'-m venv'*)
                mkdir -p "$4/bin"; rm -f "$4"/bin/*; cp "$0" "$4/bin/python" ;;
            '- '*) [ -e "$here/python" ] ;;
            *'pip install'*' -r '*)
                case "${FAKE_PIP:-ok}" in
                    ok) touch "$here/packages" ;;
                    download)
                        echo 'ERROR: No matching distribution found for numpy>=1.26'; exit 1 ;;
                    unreachable)
                        echo "WARNING: Retrying after connection broken by 'ReadTimeoutError(1)'"
                        echo 'ERROR: No matching distribution found for numpy>=1.26'; exit 1 ;;
                    full)
                        echo 'Installing collected packages: numpy'
                        echo "ERROR: [Errno 28] No space left on device: '/x'"; exit 1 ;;
                    hang)
                        echo 'Installing collected packages: numpy'
                        touch "$here/packages"; echo $$ >"$PIP_PID"; exec sleep 60 ;;
                esac ;;
            *'pip install'*)
                echo "CMAKE_PREFIX_PATH $CMAKE_PREFIX_PATH" >>"$CALLS"
                if [ "${FAKE_BUILD:-ok}" != ok ]; then
                    echo 'so3.cpp:12:3: error: expected ;'
                    echo 'ERROR: Failed building wheel'
                    exit 1
                fi
                printf '#!/bin/sh\\nprintf "<%%s>" "$PWD" "$@"\\n' >"$here/d2lio"
                chmod +x "$here/d2lio" ;;
            *'-m pytest'*)
                for word; do case "$word" in --junit-xml=*) junit=${word#*=} ;; esac; done
                [ -z "$FAKE_PYTEST" ] || printf '%s' "$FAKE_PYTEST" >"$junit"
                exit "${FAKE_PYTEST_STATUS:-0}" ;;
        esac
    """,
}

GTSAM_NEEDS = [
    *(
        f"libboost-{part}-dev"
        for part in (
            "chrono",
            "date-time",
            "filesystem",
            "program-options",
            "regex",
            "serialization",
            "system",
            "thread",
            "timer",
        )
    ),
    "libmetis-dev",
    "libsuitesparse-dev",
]

ALL_PACKAGES = [
    "build-essential",
    "cmake",
    "ninja-build",
    "libeigen3-dev",
    "libtbb-dev",
    "python3-venv",
    "python3-dev",
    "libgtest-dev",
    "libgl1",
    "chromium",
    "chromium-driver",
    "fonts-dejavu-core",
    *GTSAM_NEEDS,
    "libgtsam-dev",
]


@dataclass
class Door:
    """One checkout and its environment; ``run`` calls its front door as a user would."""

    root: Path
    bin: Path
    environment: dict[str, str]
    cwd: Path = field(init=False)

    def __post_init__(self) -> None:
        self.cwd = self.root

    def start(self, *arguments: str, **settings: str) -> subprocess.Popen[str]:
        """Starts ``./d2lio ARGUMENTS`` with extra environment variables."""
        return subprocess.Popen(
            [self.root / "d2lio", *arguments],
            env=self.environment | settings,
            cwd=self.cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *arguments: str, **settings: str) -> subprocess.CompletedProcess[str]:
        """Runs ``./d2lio ARGUMENTS`` to its end."""
        process = self.start(*arguments, **settings)
        try:
            out, err = process.communicate(timeout=TIME_LIMIT_S)
        finally:
            process.kill()
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    def calls(self) -> list[str]:
        """Fakes that changed something since the last look: apt, gtsam, venv, pip, build."""
        log = Path(self.environment["CALLS"])
        seen = []
        for line in log.read_text().splitlines():
            if line.startswith("apt-get") and " install " in line:
                seen.append("apt")
            elif line == "cmake --install build":
                seen.append("gtsam")
            elif "-m venv" in line:
                seen.append("venv")
            elif "--no-index" in line:
                seen.append("build")
            elif "-m pip install" in line and "--no-deps" not in line:  # the latter follows it
                seen.append("pip")
        log.write_text("")
        return seen

    def install_packages(self, *names: str) -> None:
        """Makes dpkg-query report these packages (and no others) as installed."""
        Path(self.environment["INSTALLED"]).write_text("".join(f"{name}\n" for name in names))

    def fake(self, name: str, body: str) -> None:
        """Puts another fake on the PATH."""
        (self.bin / name).unlink(missing_ok=True)
        (self.bin / name).write_text(f"#!/bin/sh\n{body}\n")
        (self.bin / name).chmod(0o755)


def copy_front_door(root: Path) -> None:
    """The real scripts, and small stand-ins for what they fingerprint."""
    (root / "tools").mkdir(parents=True)
    shutil.copy(REPOSITORY / "d2lio", root / "d2lio")
    shutil.copytree(REPOSITORY / "tools/door", root / "tools/door")
    shutil.copy(REPOSITORY / "pyproject.toml", root / "pyproject.toml")
    for name in ("common/src/so3.cpp", "common/tests/test_so3.cpp", "ablation/d2lio/cli.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("one\n")


def wait_for(path: Path) -> None:
    """Waits until the file is there and not empty."""
    end = time.monotonic() + TIME_LIMIT_S
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < end, f"{path} did not appear"
        time.sleep(0.02)
