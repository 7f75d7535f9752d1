# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What a source tells the hosts, host by host."""

from __future__ import annotations

import json

import numpy as np
import pytest
from d2lio import hosts
from d2lio.datasets import SourceConfig
from d2lio.errors import ConfigError, DataError
from d2lio.source_params import (
    RINGS_USED,
    all_params,
    parse_assignments,
    ring_step_for,
    source_params,
    stride_for,
)

VLP16 = {"model": "vlp16", "rings": 16, "min_range_m": 0.7, "max_range_m": 80.0}
OS1 = {"model": "os1_64", "rings": 64}


def config(**sections: object) -> SourceConfig:
    return SourceConfig.parse(sections)


def test_fast_lio_gets_ranges_and_stride() -> None:
    params = source_params(config(lidar=VLP16))
    assert params["preprocess.blind"] == "0.7"
    assert params["preprocess.max_range"] == params["mapping.det_range"] == "80.0"
    assert json.loads(params["mapping.extrinsic_R"]) == np.eye(3).ravel().tolist()
    assert params["point_filter_num"] == "1"
    assert "N_SCAN" not in params


@pytest.mark.parametrize("host", ["liosam", "d2lio"])
def test_lio_sam_gets_its_range_image(host: str) -> None:
    params = source_params(config(lidar=VLP16), host)
    assert "mapping.det_range" not in params
    assert params["preprocess.blind"] == "0.7"
    assert (params["N_SCAN"], params["Horizon_SCAN"]) == ("16", "1800")
    assert (params["downsampleRate"], params["columnByOrder"]) == ("1", "false")


def test_ranges_nobody_stated_stay_lio_sams_own() -> None:
    params = source_params(config(), "liosam")
    assert "preprocess.blind" not in params
    assert "preprocess.max_range" not in params
    assert "N_SCAN" not in params  # unknown


@pytest.mark.parametrize(
    ("host", "overrides", "stride"),
    [
        ("fastlio", {}, "3"),
        ("liosam", {}, "1"),
        ("d2lio", {}, "3"),
        ("d2lio", {"front_end": "features"}, "1"),
        ("liosam", {"front_end": "direct"}, "3"),
    ],
)
def test_no_stride_tears_the_rings_of_features(host: str, overrides: dict, stride: str) -> None:
    source = config(lidar=OS1)
    assert source_params(source, host, overrides)["point_filter_num"] == stride
    in_file = config(lidar=OS1, hosts={host: overrides})
    assert source_params(in_file, host)["point_filter_num"] == stride
    params = all_params(source, host, None, None, overrides | {"point_filter_num": "2"})
    assert params["point_filter_num"] == "2"


@pytest.mark.parametrize(
    ("lidar", "columns", "by_order"),
    [
        ({"model": "hdl64e"}, "1800", "false"),
        ({"model": "OS1_64"}, "1024", "false"),
        ({"model": "os1_64", "columns": 2048}, "2048", "false"),
        ({"model": "avia"}, "4000", "true"),
        ({"model": "mid360"}, "5000", "true"),
        ({}, "1800", "false"),
    ],
)
def test_columns_by_model(lidar: dict, columns: str, by_order: str) -> None:
    params = source_params(config(lidar=lidar), "liosam")
    assert (params["Horizon_SCAN"], params["columnByOrder"]) == (columns, by_order)


def test_sections_of_the_configuration_win_in_order() -> None:
    source = config(
        host={"imu.init_samples": 30, "live": False},
        hosts={"liosam": {"imu.init_samples": 40}, "fastlio": {"mapping.extrinsic_est_en": True}},
    )
    assert source_params(source, "liosam")["imu.init_samples"] == "40"
    assert source_params(source, "d2lio")["imu.init_samples"] == "30"
    assert source_params(source, "liosam")["live"] == "false"
    assert source_params(source, "fastlio")["mapping.extrinsic_est_en"] == "true"
    assert "mapping.extrinsic_est_en" not in source_params(source, "liosam")
    with pytest.raises(ConfigError, match="hosts"):
        config(hosts={"lio_sam": {}})


def test_modes_that_are_not_asked_for_are_the_hosts_own() -> None:
    params = all_params(config(), "d2lio", None, None, {})
    assert "rejection.mode" not in params
    assert "degeneracy.method" not in params
    params = all_params(config(), "d2lio", "off", "none", {"rejection.mode": "kiss"})
    assert (params["rejection.mode"], params["degeneracy.method"]) == ("kiss", "none")


@pytest.mark.parametrize("rings", [0, 6, 16, 32, 64, 128])
def test_stride_keeps_every_ring(rings: int) -> None:
    kept = np.arange(0, 100 * max(rings, 1), stride_for(rings)) % max(rings, 1)
    assert len(np.unique(kept)) == max(rings, 1)


@pytest.mark.parametrize("rings", [1, 6, 16, 32, 40, 64, 128])
def test_features_use_at_most_so_many_rings(rings: int) -> None:
    used = len(range(0, rings, ring_step_for(rings)))
    assert min(rings, RINGS_USED // 2) <= used < 2 * RINGS_USED
    assert used == rings or rings > RINGS_USED


def test_assignments() -> None:
    assert parse_assignments(["a.b=1", "c = x=y"]) == {"a.b": "1", "c": "x=y"}
    for text in ("a.b", "=3"):
        with pytest.raises(ConfigError, match="key=value"):
            parse_assignments([text])


@pytest.mark.parametrize("host", hosts.NEED_GTSAM)
def test_a_build_without_gtsam_says_so(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hosts, "LIOSAM_MODULE", "d2lio._no_such_module")
    assert "fastlio" in hosts.HOSTS
    with pytest.raises(DataError, match=r"D2LIO_GTSAM=on \./d2lio setup"):
        hosts.load_host(host)
