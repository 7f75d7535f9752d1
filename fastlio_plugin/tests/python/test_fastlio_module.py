# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nanobind module `d2lio._fastlio`: its own parameters and its accuracy.

What it has in common with the other hosts is tested in ablation/tests/test_host_modules.py.
"""

from __future__ import annotations

import pytest
from d2lio import runner
from d2lio._fastlio import FastLioHost
from d2lio.datasets import open_source
from d2lio.errors import ConfigError
from d2lio.metrics import evaluate
from d2lio.simulator import simulate

ROOM_ATE_M = 0.02


@pytest.mark.parametrize(
    ("mode", "method"), [("off", "none"), ("point_adaptive", "none"), ("point_adaptive", "paper")]
)
def test_whole_room_within_two_centimetres(tmp_path, mode, method):
    pytest.importorskip("evo")
    simulate("room", tmp_path / "room", seed=0)
    options = runner.RunOptions(rejection=mode, degeneracy=method)
    record = runner.run(open_source(tmp_path / "room"), options, tmp_path / "run")
    assert record.status == "complete"
    result, _ = evaluate(tmp_path / "run" / "trajectory.tum", tmp_path / "room" / "gt.tum")
    assert result.coverage > 0.97
    assert result.ate.rmse <= ROOM_ATE_M


def test_its_own_parameters():
    keys = {p["key"] for p in FastLioHost.describe()}
    assert {"filter_size_map", "mapping.acc_cov", "mapping.det_range"} <= keys
    with pytest.raises(ConfigError) as caught:
        FastLioHost({"filter_size_map": "-1"})
    assert (caught.value.key, caught.value.value) == ("filter_size_map", "-1")
    assert "0.01" in caught.value.allowed
    with pytest.raises(ConfigError, match="filter_size_mop"):
        FastLioHost({"filter_size_mop": "1"})
