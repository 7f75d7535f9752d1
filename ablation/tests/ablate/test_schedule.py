# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Whole ablations: interrupted and resumed, on a Dask cluster, sequences on the disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
import tiny
import yaml
from d2lio.ablate.ablation import AblateOptions, Ablation, ablate
from d2lio.ablate.progress import Estimate
from d2lio.errors import ConfigError, DataError

TABLES = ("results.csv", "results.parquet", "suite.yaml")
PATIENCE_S = 120.0


def run(out: Path, watcher: tiny.Memory | None = None, **options) -> Ablation:
    changes = options.pop("suite", {})
    return ablate(tiny.suite(**changes), out, AblateOptions(**options), watcher or tiny.Memory())


def tables(out: Path) -> dict[str, bytes]:
    return {name: (out / name).read_bytes() for name in TABLES}


def cells(out: Path) -> list[Path]:
    return sorted(out.glob("runs/*/*/*/cell.json"))


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny suite, run in one go with two jobs."""
    out = tmp_path_factory.mktemp("whole") / "out"
    ablation = run(out, jobs=2)
    assert ablation.problems == {}
    return out


def test_everything_is_there(uninterrupted: Path) -> None:
    text = (uninterrupted / "results.csv").read_text().splitlines()
    keys = [tuple(line.split(",")[i] for i in (1, 5, 8)) for line in text[1:]]
    assert keys == [
        (sequence, repeat, variant)
        for sequence in ("First Room", "Second")
        for repeat in "01"
        for variant in ("fastlio", "adaptive")
    ]
    assert len(cells(uninterrupted)) == 8
    assert not (uninterrupted / "sequences").exists()
    assert list(uninterrupted.rglob(".*-*")) == []


def test_one_job_gives_the_same_bytes(uninterrupted: Path, tmp_path: Path) -> None:
    memory = tiny.Memory()
    run(tmp_path / "out", memory, jobs=1)
    assert tables(tmp_path / "out") == tables(uninterrupted)
    # Sequence by sequence: a sequence is made when the cells of the one before are handed out.
    simulations = [i for i, label in enumerate(memory.labels) if label.startswith("simulating")]
    assert simulations == [0, 3, 6, 9]


def command(suite: Path, out: Path) -> list[str]:
    arguments = ["ablate", str(suite), "--out", str(out), "--jobs", "2"]
    return [sys.executable, "-m", "d2lio", *arguments]


def scratch(out: Path, where: str) -> bool:
    return any(out.glob(f"{where}/.*-*"))


MOMENTS: dict[str, tuple[Callable[[Path], bool], signal.Signals]] = {
    "simulating": (lambda out: scratch(out, "sequences"), signal.SIGKILL),
    "first run": (lambda out: scratch(out, "runs/*/*"), signal.SIGINT),
    "first result": (lambda out: len(cells(out)) >= 1, signal.SIGKILL),
    "three results": (lambda out: len(cells(out)) >= 3, signal.SIGTERM),
    "six results": (lambda out: len(cells(out)) >= 6, signal.SIGKILL),
}


def test_interrupted_at_any_moment_the_tables_are_the_same(
    uninterrupted: Path, tmp_path: Path
) -> None:
    suite, out = tmp_path / "suite.yaml", tmp_path / "out"
    suite.write_text(yaml.safe_dump(tiny.data()))
    seen: dict[Path, int] = {}
    for reached, number in MOMENTS.values():
        process = subprocess.Popen(command(suite, out), stderr=subprocess.PIPE)
        children = _interrupt(process, lambda reached=reached: reached(out), number)
        _wait_until_gone(children)
        assert process.returncode in (-number, 130)
        assert not (out / "results.csv").exists()
        for cell, inode in seen.items():
            assert cell.stat().st_ino == inode, "a finished cell ran again"
        seen = {cell: cell.stat().st_ino for cell in cells(out)}
    last = subprocess.run(command(suite, out), capture_output=True, text=True, check=True)
    assert f"{len(seen)} of 8 cells are done already" in last.stderr
    assert tables(out) == tables(uninterrupted)
    assert all(cell.stat().st_ino == inode for cell, inode in seen.items())
    assert not (out / "sequences").exists()
    assert list(out.rglob(".*-*")) == []


def _interrupt(
    process: subprocess.Popen, reached: Callable[[], bool], number: signal.Signals
) -> list[psutil.Process]:
    """Sends the signal as soon as `reached`; returns the processes that were below it."""
    end = time.monotonic() + PATIENCE_S
    while not reached():
        assert process.poll() is None, "it ended before"
        assert time.monotonic() < end
        time.sleep(0.002)
    children = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(number)
    process.wait(PATIENCE_S)
    return children


def _wait_until_gone(processes: list[psutil.Process]) -> None:
    _, alive = psutil.wait_procs(processes, timeout=PATIENCE_S)
    assert alive == []


def test_nothing_left_to_do_runs_nothing(uninterrupted: Path) -> None:
    before, memory = tables(uninterrupted), tiny.Memory()
    run(uninterrupted, memory)
    assert memory.labels == []
    assert tables(uninterrupted) == before


def test_changed_variants_alone_run_again(uninterrupted: Path) -> None:
    memory = tiny.Memory()
    changed = {**tiny.ADAPTIVE, "title": "Adaptive", "params": {"rejection.epsilon_0": 0.7}}
    suite = {"variants": [{**tiny.FASTLIO, "title": "FAST"}, changed]}
    ablation = run(uninterrupted, memory, suite=suite)
    assert {label.split()[-1] for label in memory.done} == {"adaptive"}
    assert len(memory.done) == 4
    assert {row.variant_title for row in ablation.results.rows} == {"FAST", "Adaptive"}
    run(uninterrupted)  # as it was, for the other tests


def test_tables_of_before_do_not_outlive_what_they_were_made_of(tmp_path: Path) -> None:
    suite = {"repeats": 1, "sequences": [{"name": "Short", "simulate": tiny.ROOM}]}
    out = tmp_path / "out"
    run(out, suite=suite)

    def stop(count: int) -> None:
        raise KeyboardInterrupt

    suite["variants"] = [tiny.FASTLIO, {**tiny.ADAPTIVE, "rejection": "kiss"}]
    with pytest.raises(KeyboardInterrupt):
        run(out, tiny.Memory(stop), suite=suite)
    assert not any((out / name).exists() for name in TABLES if name != "suite.yaml")
    ablation = run(out, suite=suite)
    assert [row.rejection for row in ablation.results.rows] == ["off", "kiss"]


def test_fresh_runs_everything_again(tmp_path: Path) -> None:
    suite = {"repeats": 1, "sequences": [{"name": "Short", "simulate": tiny.ROOM}]}
    run(tmp_path / "out", suite=suite)
    before, memory = tables(tmp_path / "out"), tiny.Memory()
    run(tmp_path / "out", memory, suite=suite, fresh=True)
    assert len(memory.done) == 2
    assert tables(tmp_path / "out") == before


def test_keep_sequences(tmp_path: Path) -> None:
    suite = {"repeats": 1, "variants": [tiny.FASTLIO]}
    run(tmp_path / "out", suite=suite, keep_sequences=True)
    kept = sorted((tmp_path / "out" / "sequences").iterdir())
    assert [p.name[:-9] for p in kept] == ["First_Room_s0", "Second_s7"]
    assert all((p / "data.bag").exists() for p in kept)
    run(tmp_path / "out", suite=suite)
    assert not (tmp_path / "out" / "sequences").exists()


def test_what_cannot_be_simulated_leaves_the_rest_and_is_tried_again(tmp_path: Path) -> None:
    bad = {"name": "Endless", "simulate": {"scene": "room", "duration": 1e5}}
    good = {"name": "Short", "simulate": tiny.ROOM}
    suite = {"repeats": 1, "sequences": [bad, good]}
    for _ in range(2):
        memory = tiny.Memory()
        ablation = run(tmp_path / "out", memory, suite=suite)
        assert len(memory.problems) == 1
        assert len(ablation.problems) == 2
    rows = ablation.results.rows
    assert [row.status for row in rows] == ["fail", "fail", "ok", "ok"]
    assert rows[0].reason.startswith("not carried out: simulation: duration")


def test_a_directory_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(DataError, match="holds no ablation"):
        run(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_another_suites_directory_is_refused(uninterrupted: Path) -> None:
    with pytest.raises(DataError, match="holds the suite tiny"):
        run(uninterrupted, suite={"name": "other"})


def test_two_at_once_in_one_directory_are_refused(tmp_path: Path) -> None:
    refusals = []

    def again(count: int) -> None:
        if count == 1:
            with pytest.raises(DataError, match="another ablation is at work"):
                run(tmp_path / "out")
            refusals.append(count)

    suite = {"repeats": 1, "sequences": [{"name": "a", "simulate": tiny.ROOM}]}
    run(tmp_path / "out", tiny.Memory(again), suite=suite)
    assert refusals == [1]


def test_a_host_that_is_not_known_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="host = 'fast'"):
        run(tmp_path / "out", suite={"variants": [tiny.FASTLIO, {"id": "a", "host": "fast"}]})


def test_the_time_left_comes_from_the_same_variant() -> None:
    estimate = Estimate()
    for variant in ("a", "a", "a", "b", "c"):
        estimate.expect(variant)
    estimate.expect_sequence()
    assert estimate.remaining_s(2) is None
    estimate.done("a", 10.0)
    estimate.done("b", 40.0)
    # Two of a at 10 s, one of c at the mean of all, on two slots.
    assert estimate.remaining_s(2) == pytest.approx((2 * 10.0 + 25.0) / 2)
    estimate.expect_sequence()
    estimate.made(6.0)
    assert estimate.remaining_s(1) == pytest.approx(2 * 10.0 + 25.0 + 6.0)


@pytest.fixture
def cluster() -> Iterator:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as made:
        yield made


def test_on_a_cluster_with_a_worker_killed(uninterrupted: Path, tmp_path: Path, cluster) -> None:
    killed: list[int] = []

    killer = threading.Thread(
        target=lambda: killed.append(_kill_busy_worker(cluster.scheduler_address))
    )

    def kill(count: int) -> None:
        if count == 4:
            killer.start()  # while the ablation goes on

    memory = tiny.Memory(kill)
    ablation = run(tmp_path / "out", memory, scheduler=cluster.scheduler_address)
    killer.join()
    assert len(killed) == 1
    assert ablation.problems == {}
    assert sorted(memory.done) == sorted(set(memory.done))
    assert len(memory.done) == 8
    assert tables(tmp_path / "out") == tables(uninterrupted)


def _kill_busy_worker(address: str) -> int:
    """Kills a worker in the middle of a cell."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            at_work = client.processing().items()
            busy = [w for w, keys in at_work if any(str(k).startswith("execute") for k in keys)]
            if busy:
                pid = client.run(os.getpid, workers=busy[:1])[busy[0]]
                os.kill(pid, signal.SIGKILL)
                return pid
            time.sleep(0.01)
    raise AssertionError("no worker was ever busy")


def test_no_cluster_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("d2lio.ablate.cluster.CONNECT_S", 0.5)
    with pytest.raises(DataError, match="no Dask scheduler"):
        run(tmp_path / "out", scheduler="tcp://127.0.0.1:9")
