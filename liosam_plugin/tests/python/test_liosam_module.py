# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nanobind module `d2lio._liosam`: presets, accuracy, every scene in every mode.

What it has in common with the other hosts is tested in ablation/tests/test_host_modules.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from built import needs_gtsam
from d2lio import runner
from d2lio.datasets import ImuBlock, Source, open_source, timed_events
from d2lio.errors import ConfigError
from d2lio.hosts import describe, load_host
from d2lio.metrics import evaluate
from d2lio.simulator import SCENES, simulate
from d2lio.source_params import all_params

pytestmark = needs_gtsam

ROOM_ATE_M = {"liosam": 0.03, "d2lio": 0.02}
# What LIO-SAM's own params.yaml recommends indoors.
INDOOR = {
    "odometrySurfLeafSize": "0.2",
    "mappingCornerLeafSize": "0.1",
    "mappingSurfLeafSize": "0.2",
}
START_SCANS = 6  # at most so many are all taken, while biases settle
SHORT_S = 4.0  # two of them at rest
# Every rejection mode and every method, and D2-LIO's own pair.
MODES = (
    ("off", "none"),
    ("off", "remap"),
    ("none", "none"),
    ("fixed", "paper"),
    ("kiss", "remap"),
    ("point_adaptive", "paper"),
)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sequences") / "room"
    simulate("room", out, seed=0)
    return out


def _ate(room: Path, out: Path, host: str, **options) -> float:
    record = runner.run(open_source(room), runner.RunOptions(host=host, **options), out)
    assert record.status == "complete"
    result, _ = evaluate(out / "trajectory.tum", room / "gt.tum")
    assert result.coverage > 0.97
    assert result.ate is not None
    return result.ate.rmse


def test_lio_sam_crosses_the_room(room: Path, tmp_path: Path) -> None:
    pytest.importorskip("evo")
    ate = _ate(room, tmp_path / "run", "liosam", rejection="off", params=INDOOR)
    assert ate <= ROOM_ATE_M["liosam"]


def test_d2_lio_crosses_the_room(room: Path, tmp_path: Path) -> None:
    pytest.importorskip("evo")
    assert _ate(room, tmp_path / "run", "d2lio") <= ROOM_ATE_M["d2lio"]


def test_presets() -> None:
    liosam, d2lio = (
        {entry["key"]: entry["default"] for entry in describe(host)} for host in ("liosam", "d2lio")
    )
    assert list(liosam) == list(d2lio)
    assert (liosam["front_end"], d2lio["front_end"]) == ("features", "direct")
    assert (liosam["rejection.mode"], d2lio["rejection.mode"]) == ("off", "point_adaptive")
    assert (liosam["degeneracy.method"], d2lio["degeneracy.method"]) == ("none", "noise_aware")
    assert float(liosam["mappingProcessInterval"]) == 0.15
    assert float(liosam["preprocess.blind"]) == 1.0


@pytest.mark.parametrize(
    ("key", "value"),
    [("N_SCAN", "0"), ("surroundingKeyframeDensity", "-1"), ("front_end", "feature"),
     ("imuRPYWeight", "2"), ("mappingSurfLeafSize", "nan")],
)  # fmt: skip
def test_its_own_parameters_are_refused_by_name(key: str, value: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_host("liosam")({key: value})
    assert (caught.value.key, caught.value.value) == (key, value)


def test_lio_sam_gives_poses_at_its_mapping_interval(room: Path, tmp_path: Path) -> None:
    options = runner.RunOptions(host="liosam", max_scans=40)
    record = runner.run(open_source(room), options, tmp_path / "run")
    assert record.scans.dropped["no_pose_skipped"] == pytest.approx(18, abs=2)
    stamps = np.loadtxt(tmp_path / "run" / "trajectory.tum")[:, 0]
    assert np.diff(stamps)[START_SCANS:] == pytest.approx(0.2, abs=0.01)


@pytest.fixture(scope="module", params=sorted(SCENES))
def scene(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """A few seconds of a scene: the source, and its events decoded once for all runs."""
    out = tmp_path_factory.mktemp("scenes") / request.param
    simulate(request.param, out, seed=2, duration=SHORT_S)
    source = open_source(out)
    return source, list(timed_events(source.reader))


@pytest.mark.parametrize("host", ["liosam", "d2lio"])
def test_every_scene_runs_in_every_mode(scene: tuple[Source, list], host: str) -> None:
    source, events = scene
    scans = sum(not isinstance(event, ImuBlock) for event in events)
    for mode, method in MODES:
        params = all_params(source.config, host, mode, method, {})
        results = _run(load_host(host)(params, 1), events)
        poses = [r for r in results if r.has_pose]
        assert len(results) == scans, (mode, method)
        assert len(poses) >= (scans // 2 - 2 if host == "liosam" else scans - 2), (mode, method)
        for r in poses:
            assert np.isfinite(r.T_map_imu).all(), (mode, method)
            assert np.linalg.eigvalsh(r.covariance).min() >= 0.0, (mode, method)


def _run(host, events: list) -> list:
    results = []
    for event in events:
        if isinstance(event, ImuBlock):
            host.add_imu(event.stamps, event.gyro, event.accel, event.orientation)
        else:
            host.add_scan(event.stamp, event.xyz, event.dt_ns, event.intensity, event.ring)
    host.finish()
    while (result := host.step()) is not None:
        results.append(result)
    return results
