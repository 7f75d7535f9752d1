# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Peers behind the hosts' interface: a fake one that misbehaves, and KISS-ICP through the pipe."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from d2lio import hosts
from d2lio.cli import app
from d2lio.datasets import open_source
from d2lio.errors import ConfigError, DataError
from d2lio.metrics import evaluate
from d2lio.peers import PEERS
from d2lio.peers.environments import override_variable
from d2lio.peers.host import PeerHost
from d2lio.runner import RunOptions, run
from d2lio.simulator import simulate
from fake_peer import MISBEHAVE_AT, SPEED
from typer.testing import CliRunner

FAKE = Path(__file__).parent / "fake_peer.py"
NS = 1_000_000_000
START = 1_700_000_000 * NS
PERIOD = NS // 10
SCANS = 6
HANG_S = "1.0"
KISS_ATE_M = 0.1  # a room of 4 s, 2 s of them standing; 1 m of voxels
DIES_S = 10.0


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch):
    """Makes a host of fake_peer.py that behaves as said."""
    peer = replace(PEERS["rko-lio"], name="fake-peer", worker=str(FAKE), settings=())
    monkeypatch.setenv(override_variable(peer), sys.executable)

    def make(how: str, **params: str) -> PeerHost:
        return PeerHost(replace(peer, driver=how), params)

    return make


def feed(host: PeerHost, scans: int = SCANS) -> list:
    """A drive of 100 points a scan with IMU; all results."""
    results = []
    for k in range(scans):
        begin = START + k * PERIOD
        xyz = np.full((100, 3), 5.0, np.float32)
        dt_ns = np.linspace(0, PERIOD - 1, 100).astype(np.int32)
        host.add_scan(begin, xyz, dt_ns, None, np.zeros(100, np.uint16))
        assert host.step() is None, "processed before its IMU samples came"
        stamps = begin + np.arange(1, 22) * (PERIOD // 20)
        host.add_imu(stamps, np.zeros((21, 3)), np.tile([0.0, 0.0, 9.8], (21, 1)))
        while (result := host.step()) is not None:
            results.append(result)
    host.finish()
    while (result := host.step()) is not None:
        results.append(result)
    return results


def gone(pid: int) -> bool:
    deadline = time.monotonic() + DIES_S
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.05)
    return False


def test_poses_come_with_their_own_stamps_and_times(fake) -> None:
    host = fake("good")
    results = feed(host)
    assert [r.stamp for r in results] == [START + (k + 1) * PERIOD - 1 for k in range(SCANS)]
    x = [r.T_map_imu[0, 3] for r in results]
    np.testing.assert_allclose(x, SPEED * 0.1 * np.arange(SCANS))
    assert {r.status for r in results} == {"ok"}
    assert all(r.has_pose and r.health == "OK" for r in results)
    assert all(r.diagnostics["time_total_ms"] == 1.5 for r in results)
    counts = host.counts()
    assert (counts["scans_given"], counts["poses"]) == (SCANS, SCANS)
    # Every block but the first repeats the last stamp of the one before.
    assert counts["imu_accepted"] == 20 * SCANS + 1
    assert counts["imu_dropped_late"] == SCANS - 1
    assert counts["worker_peak_memory_mb"] == 7
    assert gone(int(host.version))


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("crash", r"fake-peer crashed \(SIGABRT\)"),
        ("hang", r"fake-peer took longer than 1 s \(scan\)"),
        ("exit", r"fake-peer ended with exit code 7; it said: error: out of luck"),
        ("garbage", r"fake-peer answered with bytes that are no message"),
        ("too_many", r"fake-peer gave more poses than scans"),
        ("nonsense", r"fake-peer answered with nonsense"),
        ("refuses_all", r"fake-peer gave no pose: too few points"),
    ],
)
def test_a_misbehaving_peer_is_a_failed_run(fake, how: str, said: str) -> None:
    host = fake(how, timeout_s=HANG_S)
    with pytest.raises(DataError, match=said):
        # too_many shows at the second pose more than scans were given
        feed(host)
    assert gone(int(host.version))


def test_a_refused_scan_is_counted_and_the_run_goes_on(fake) -> None:
    host = fake("refuses")
    results = feed(host)
    assert [r.has_pose for r in results] == [k != MISBEHAVE_AT for k in range(SCANS)]
    assert (results[MISBEHAVE_AT].status, results[MISBEHAVE_AT].health) == ("refused", "LOST")
    assert host.counts()["scans_refused"] == 1


def test_a_repeated_pose_is_dropped(fake) -> None:
    host = fake("repeats")
    assert len(feed(host)) == SCANS - 1
    assert host.counts()["poses_out_of_order"] == 1


def test_points_out_of_range_and_late_scans_do_not_reach_the_peer(fake) -> None:
    host = fake("good", **{"lidar.min_range_m": "1.0", "lidar.max_range_m": "50.0"})
    xyz = np.array([[0, 0, 0], [np.nan, 1, 1], [0.5, 0, 0], [60, 0, 0]], np.float32)
    host.add_scan(START, xyz, np.arange(4, dtype=np.int32), None, None)
    assert host.counts()["scans_empty"] == 1
    good = np.full((4, 3), 5.0, np.float32)
    for stamp in (START, START - 2 * NS):
        host.add_scan(stamp, good, np.arange(4, dtype=np.int32), None, None)
    assert host.counts()["scans_dropped_late"] == 1
    host.finish()
    result = host.step()
    assert result is not None
    assert result.stamp == START + 3


def test_the_worker_ends_with_its_host(fake) -> None:
    host = fake("good")
    pid = int(host.version)
    assert not Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].startswith(" Z")
    del host
    gc.collect()
    assert gone(pid)


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's help is Linux's")
def test_a_busy_worker_dies_with_its_parent(tmp_path: Path) -> None:
    """The parent is killed while the worker does not read its input."""
    workers = Path(hosts.__file__).parent / "peers" / "workers"
    hung = tmp_path / "hung.py"
    hung.write_text(
        f"import os, sys, time\nsys.path.insert(0, {str(workers)!r})\nimport serve\n"
        "serve.die_with(int(sys.argv[1]))\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(f'{{os.getpid()}}.')\ntime.sleep(3600)\n"
    )
    code = (
        "import os, subprocess, sys, time\n"
        f"subprocess.Popen([sys.executable, {str(hung)!r}, str(os.getpid())])\ntime.sleep(3600)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code])
    pid_file = tmp_path / "pid"
    deadline = time.monotonic() + DIES_S
    while not (pid_file.exists() and pid_file.read_text().endswith(".")):
        assert time.monotonic() < deadline, "the worker did not start"
        time.sleep(0.05)
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    assert gone(int(pid_file.read_text()[:-1]))


def test_every_peer_is_a_host_with_a_title() -> None:
    for name, peer in PEERS.items():
        assert hosts.TITLES[name] == hosts.SHORT_TITLES[name] == peer.title
        rows = hosts.describe(name)
        assert {"timeout_s", "mapping.extrinsic_T"} <= {row["key"] for row in rows}
        assert all(set(row) == set(hosts.describe("fastlio")[0]) for row in rows)
        assert not set(PEERS) & set(hosts.HOSTS)
    with pytest.raises(ConfigError, match="kiss-icp"):
        hosts.load_host("kiss")


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"rejection.mode": "kiss"}, "KISS-ICP has no such stage"),
        ({"degeneracy.method": "paper"}, "KISS-ICP has no such stage"),
        ({"voxel_size": "-1"}, r"\[0, 5\]"),
        ({"voxel_size": "wide"}, r"float in \[0, 5\]"),
        ({"voxel_size": "nan"}, r"\[0, 5\]"),
        ({"deskew": "maybe"}, "true, false"),
        ({"voxel": "1"}, "no such key; known: voxel_size"),
        ({"mapping.extrinsic_R": "[1, 0, 0, 0, 1, 0, 0, 0, -1]"}, "SO"),
        ({"mapping.extrinsic_T": "[1, 2]"}, "3 numbers"),
    ],
)
def test_what_a_peer_cannot_be_told_is_refused(params: dict[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        hosts.load_host("kiss-icp")(params, 1)


def test_a_peer_that_is_not_installed_is_refused_with_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(override_variable(PEERS["kiss-icp"]), raising=False)
    monkeypatch.setenv("D2LIO_PEERS", str(tmp_path / "none"))
    with pytest.raises(DataError, match="run: d2lio peers install kiss-icp"):
        hosts.load_host("kiss-icp")({}, 1)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sequences") / "room"
    simulate("room", path, seed=0, duration=4.0)
    return path


def test_kiss_icp_through_the_pipe(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this interpreter, which has it for the tests; nothing is installed."""
    pytest.importorskip("kiss_icp")
    monkeypatch.setenv(override_variable(PEERS["kiss-icp"]), sys.executable)
    out = tmp_path / "run"
    record = run(open_source(room), RunOptions(host="kiss-icp"), out)
    assert record.status == "complete"
    assert record.scans.processed == record.scans.read == 37
    assert record.params["voxel_size"] == "0.0"
    assert record.params["lidar.min_range_m"] == "0.5"
    assert record.time_ms["total"].median > 0.0
    result, _ = evaluate(out / "trajectory.tum", room / "gt.tum")
    assert result.status == "ok"
    assert result.ate is not None
    assert result.ate.rmse < KISS_ATE_M
    again = run(open_source(room), RunOptions(host="kiss-icp"), tmp_path / "again")
    assert again.scans == record.scans
    texts = [(d / "trajectory.tum").read_bytes() for d in (out, tmp_path / "again")]
    assert texts[0] == texts[1]


def test_the_command_refuses_a_mode_with_a_peer(room: Path, tmp_path: Path) -> None:
    arguments = ["run", str(room), "--host", "kiss-icp", "--rejection", "kiss"]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "run")])
    assert result.exit_code == 2
    assert "rejection.mode" in result.output
    assert not (tmp_path / "run").exists()
