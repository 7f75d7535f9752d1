# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The configuration files in liosam_plugin/config: every host takes them, they fit the sensor."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from built import host_params
from d2lio.datasets import SourceConfig, open_source
from d2lio.hosts import describe, load_host
from d2lio.metrics import evaluate
from d2lio.runner import RunOptions, run
from d2lio.simulator import SENSORS, simulate
from d2lio.source_params import all_params, source_params

CONFIGS = Path(__file__).parents[2] / "config"
FILES = {file.stem: file for file in sorted(CONFIGS.glob("*.yaml"))}
SIMULATED = {"vlp16": "vlp16", "hdl32e": "hdl32e", "os1_64": "os1_64", "livox_avia": "avia"}
STREET_ATE_M = 0.15  # over 5 s of a street; one seed
UNUSED_BY = {"fastlio": ("N_SCAN", "Horizon_SCAN", "columnByOrder", "downsampleRate")}


def test_there_is_a_file_for_every_simulated_sensor() -> None:
    assert set(SIMULATED) == set(FILES)
    assert set(SIMULATED.values()) == set(SENSORS)


@pytest.mark.parametrize("host", host_params())
@pytest.mark.parametrize("name", FILES)
def test_every_host_takes_it(name: str, host: str) -> None:
    config = SourceConfig.load(FILES[name])
    params = all_params(config, host, None, None, {})
    load_host(host)(params, 1)
    assert set(params) <= {entry["key"] for entry in describe(host)}
    assert not set(params) & set(UNUSED_BY.get(host, ()))
    load_host(host)(all_params(config, host, "kiss", "remap", {}), 1)


@pytest.mark.parametrize("name", FILES)
def test_it_describes_the_sensor(name: str) -> None:
    config = SourceConfig.load(FILES[name])
    sensor = SENSORS[SIMULATED[name]]
    assert config.lidar.rings == sensor.rings
    assert config.lidar.model == sensor.model
    params = source_params(config, "liosam")
    assert params["columnByOrder"] == ("true" if name == "livox_avia" else "false")
    assert params["point_filter_num"] == "1"
    assert params["rejection.mode"] == "off"
    d2lio = source_params(config, "d2lio")
    assert (d2lio["front_end"], d2lio["degeneracy.method"]) == ("direct", "noise_aware")


@pytest.mark.parametrize("host", host_params(("liosam", "d2lio")))
@pytest.mark.parametrize("name", FILES)
def test_a_drive_with_this_sensor(name: str, host: str, tmp_path: Path) -> None:
    pytest.importorskip("evo")
    made = simulate("dense_street", tmp_path / "s", sensor=SIMULATED[name], duration=5.0)
    content = yaml.safe_load(FILES[name].read_text(encoding="utf-8"))
    # The simulated rig: its own mount and topics, point times in the Velodyne driver's field.
    content["T_imu_lidar"] = made.T_imu_lidar
    content["lidar"] |= {"topic": made.lidar.topic, "time_field": "time", "time_unit": "s"}
    content["imu"] |= {"topic": made.imu.topic, "rate_hz": 200.0, "accel_unit": "m/s^2"}
    config = tmp_path / "c.yaml"
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    record = run(open_source(made.bag_path, config), RunOptions(host=host), tmp_path / "run")
    assert record.status == "complete"
    result, _ = evaluate(tmp_path / "run" / "trajectory.tum", tmp_path / "s" / "gt.tum")
    assert result.coverage > 0.9
    assert result.ate is not None
    assert result.ate.rmse < STREET_ATE_M
