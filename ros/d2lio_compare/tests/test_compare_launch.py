# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""compare.launch from start to end: real nodes on a simulated bag, a roscore on loopback."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from d2lio.ablate.results import ResultRow, load_rows
from d2lio.metrics import read_tum
from d2lio.simulator import simulate

SETUP = os.environ.get("D2LIO_ROS_SETUP", "")
pytestmark = pytest.mark.skipif(
    not SETUP, reason="no ROS build (D2LIO_ROS_SETUP is unset; `./d2lio test --ros` sets it)"
)

DURATION_S = 8.0
VARIANTS = ("off", "none", "d2")
PATIENCE_S = 150.0
APE_TOLERANCE_M = 1e-6
POSE_TOLERANCE = 1e-9  # m, and of quaternions
RATE = 2


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("compare") / "room"
    simulate("room", path, duration=DURATION_S)
    return path


class Launched:
    """`d2lio launch compare` at work."""

    def __init__(self, *arguments: str, out: Path) -> None:
        self.out = out
        self._log = (out.parent / f"{out.name}.log").open("w+", encoding="utf-8")
        command = [sys.executable, "-m", "d2lio", "launch", "compare", *arguments]
        command += ["--headless", "--out", str(out), "--rate", str(RATE)]
        text = f"source {shlex.quote(SETUP)}; exec {shlex.join(command)}"
        self._process = subprocess.Popen(
            ["bash", "-c", text], stdout=self._log, stderr=subprocess.STDOUT
        )

    @property
    def said(self) -> str:
        self._log.flush()
        return Path(self._log.name).read_text(encoding="utf-8", errors="replace")

    def processes(self) -> list[psutil.Process]:
        return psutil.Process(self._process.pid).children(recursive=True)

    def node(self, variant: str) -> psutil.Process:
        for process in self.processes():
            try:
                name, namespace = process.name(), process.environ().get("ROS_NAMESPACE", "")
            except psutil.Error:
                continue
            if name == "d2lio_fastlio" and namespace.strip("/") == variant:
                return process
        raise AssertionError(f"no node of {variant}:\n{self.said}")

    def scans(self, variant: str) -> int:
        try:
            state = json.loads((self.out / "scoreboard.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return 0
        return int(state["variants"][variant]["scans"])

    def wait_until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < end, self.said
            assert self._process.poll() is None, self.said
            time.sleep(0.1)

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def wait(self) -> int:
        return self._process.wait(PATIENCE_S)

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait(PATIENCE_S)
        self._log.close()


@pytest.fixture
def launched(tmp_path: Path) -> Iterator[Callable[..., Launched]]:
    begun: list[Launched] = []

    def start(*arguments: str) -> Launched:
        begun.append(Launched(*arguments, out=tmp_path / f"out{len(begun)}"))
        return begun[-1]

    yield start
    for each in begun:
        each.close()


def rows_of(out: Path) -> dict[str, ResultRow]:
    return {row.variant: row for row in load_rows(out)}


def offline(sequence: Path, out: Path) -> Path:
    command = [sys.executable, "-m", "d2lio", "compare", str(sequence), "--out", str(out)]
    subprocess.run([*command, "--variants", "d2", "--no-viewer"], check=True, capture_output=True)
    return out


def test_the_scoreboard_ends_with_the_figures_of_evo_and_of_the_offline_run(
    launched, room: Path, tmp_path: Path
) -> None:
    run = launched(str(room), "--variants", ",".join(VARIANTS) + ",upstream:fast_lio")
    assert run.wait() == 0, run.said
    assert "FAST_LIO (upstream) left out" in run.said
    rows = rows_of(run.out)
    assert list(rows) == list(VARIANTS)
    state = json.loads((run.out / "scoreboard.json").read_text(encoding="utf-8"))["variants"]
    for name, row in rows.items():
        assert row.status == "ok", row.reason
        assert state[name]["ape"] == pytest.approx(row.ate_m, abs=APE_TOLERANCE_M)
    assert (run.out / "report.html").is_file()
    apart = offline(room, tmp_path / "offline")
    expected = rows_of(apart)["d2"]
    assert rows["d2"].ate_m == pytest.approx(expected.ate_m, abs=POSE_TOLERANCE)
    ours = read_tum(run.out / "nodes" / "d2" / "trajectory.tum")
    theirs = read_tum(apart / expected.directory / "trajectory.tum")
    assert ours.stamps.tolist() == theirs.stamps.tolist()
    assert ours.positions == pytest.approx(theirs.positions, abs=POSE_TOLERANCE)
    assert ours.quaternions == pytest.approx(theirs.quaternions, abs=POSE_TOLERANCE)


def test_a_killed_variant_is_a_failed_row_and_the_others_go_on(launched, room: Path) -> None:
    run = launched(str(room), "--variants", ",".join(VARIANTS))
    run.wait_until(lambda: run.scans("none") > 10)
    run.node("none").kill()
    assert run.wait() == 0, run.said
    assert "none is DEAD" in run.said
    rows = rows_of(run.out)
    assert (rows["none"].status, rows["none"].reason) == ("fail", "the node died")
    assert rows["none"].scans_processed > 10
    complete = [rows[name].scans_processed for name in ("off", "d2")]
    assert complete[0] == complete[1] > rows["none"].scans_processed
    assert [rows[name].status for name in ("off", "d2")] == ["ok", "ok"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopping_it_saves_everything_and_leaves_no_process(
    launched, room: Path, number: int, code: int
) -> None:
    run = launched(str(room), "--variants", "off,d2")
    run.wait_until(lambda: run.scans("off") > 10 and run.scans("d2") > 10)
    begun = run.processes()
    run.signal(number)
    assert run.wait() == code, run.said
    assert psutil.wait_procs(begun, timeout=10.0)[1] == []
    rows = rows_of(run.out)
    for name in ("off", "d2"):
        poses = read_tum(run.out / "nodes" / name / "trajectory.tum")
        assert len(poses) == rows[name].scans_processed > 10
        assert (run.out / "nodes" / name / "run.json").is_file()
    assert (run.out / "report.html").is_file()


def test_killed_itself_it_leaves_no_process(launched, room: Path) -> None:
    run = launched(str(room), "--variants", "off,d2")
    run.wait_until(lambda: run.scans("off") > 5)
    begun = run.processes()
    run.signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    assert psutil.wait_procs(begun, timeout=40.0)[1] == []
    assert len(read_tum(run.out / "nodes" / "off" / "trajectory.tum")) > 5


def test_an_unknown_variant_is_refused_at_once(launched, room: Path) -> None:
    run = launched(str(room), "--variants", "off,turbo")
    assert run.wait() == 2
    assert "turbo" in run.said
    assert "point_adaptive" in run.said
    assert not run.out.exists()
