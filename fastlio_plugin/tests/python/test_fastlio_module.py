# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nanobind module `d2lio._fastlio` on short simulated sequences."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from d2lio import runner
from d2lio._fastlio import FastLioHost
from d2lio.datasets import ImuBlock, open_source, timed_events
from d2lio.errors import ConfigError
from d2lio.metrics import evaluate
from d2lio.simulator import simulate

ROOM_ATE_M = 0.02


def _run(sequence: Path, out: Path, **options):
    record = runner.run(open_source(sequence), runner.RunOptions(**options), out)
    return record, np.genfromtxt(
        out / "diagnostics.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("room") / "room"
    simulate("room", out, seed=0, duration=8.0)
    return out


@pytest.mark.parametrize(
    ("mode", "method"), [("off", "none"), ("point_adaptive", "none"), ("point_adaptive", "paper")]
)
def test_whole_room_within_two_centimetres(tmp_path, mode, method):
    pytest.importorskip("evo")
    simulate("room", tmp_path / "room", seed=0)
    record, _ = _run(tmp_path / "room", tmp_path / "run", rejection=mode, degeneracy=method)
    assert record.status == "complete"
    result, _ = evaluate(tmp_path / "run" / "trajectory.tum", tmp_path / "room" / "gt.tum")
    assert result.coverage > 0.97
    assert result.ate.rmse <= ROOM_ATE_M


def test_the_room_is_not_called_degenerate(room, tmp_path):
    record, rows = _run(room, tmp_path / "run")
    assert record.health.get("OK", 0) >= 0.95 * (len(rows) - 3)


@pytest.mark.parametrize("mode", ["off", "point_adaptive"])
def test_two_threads_give_the_same_bytes(room, tmp_path, mode):
    outputs = []
    for name, threads in (("one", 1), ("two", 2), ("again", 2)):
        _run(room, tmp_path / name, rejection=mode, degeneracy="paper", threads=threads)
        outputs.append((tmp_path / name / "trajectory.tum").read_bytes())
    assert outputs[0] == outputs[1] == outputs[2]


def test_describe_names_every_parameter():
    keys = {p["key"] for p in FastLioHost.describe()}
    assert {"rejection.mode", "degeneracy.w", "filter_size_map", "mapping.acc_cov"} <= keys
    for p in FastLioHost.describe():
        assert set(p) == {"key", "type", "default", "range", "unit", "doc"}


def test_refused_parameters_reach_python_with_their_names():
    with pytest.raises(ConfigError) as caught:
        FastLioHost({"filter_size_map": "-1"})
    assert (caught.value.key, caught.value.value) == ("filter_size_map", "-1")
    assert "0.01" in caught.value.allowed
    with pytest.raises(ConfigError, match="filter_size_mop"):
        FastLioHost({"filter_size_mop": "1"})


def test_arrays_of_different_length_are_refused():
    host = FastLioHost()
    with pytest.raises(ValueError, match="length"):
        host.add_imu(np.zeros(2, np.int64), np.zeros((3, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="length"):
        host.add_scan(0, np.zeros((4, 3), np.float32), np.zeros(3, np.int32))


def test_without_data_there_is_nothing_to_step():
    host = FastLioHost()
    assert host.step() is None
    host.finish()
    assert host.step() is None
    assert host.map_points().shape == (0, 3)


def test_stamps_and_offsets_are_not_converted_silently():
    host = FastLioHost()
    with pytest.raises(TypeError):
        host.add_imu(np.zeros(2), np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(TypeError):
        host.add_scan(0, np.zeros((4, 3), np.float32), np.linspace(0, 0.1, 4))


def test_data_after_finish_is_refused():
    host = FastLioHost()
    host.finish()
    with pytest.raises(RuntimeError, match="no more data"):
        host.add_imu(np.array([1], np.int64), np.zeros((1, 3)), np.full((1, 3), 9.81))
    with pytest.raises(RuntimeError, match="no more data"):
        host.add_scan(1, np.ones((4, 3), np.float32), np.zeros(4, np.int32))


def test_threads_may_share_a_host(room):
    host = FastLioHost({"point_filter_num": "1"})
    scans, samples = [], []
    for event in timed_events(open_source(room).reader):
        (samples if isinstance(event, ImuBlock) else scans).append(event)

    def feed_imu():
        for block in samples:
            host.add_imu(block.stamps, block.gyro, block.accel)

    def feed_scans():
        for scan in scans:
            host.add_scan(scan.stamp, scan.xyz, scan.dt_ns)

    results = []
    workers = [threading.Thread(target=feed_imu), threading.Thread(target=feed_scans)]
    for worker in workers:
        worker.start()
    while any(w.is_alive() for w in workers) or not results or results[-1] is not None:
        results.append(host.step())
    assert sum(r is not None for r in results) >= len(scans) - 1
