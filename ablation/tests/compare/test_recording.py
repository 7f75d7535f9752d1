# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The recording for rerun, read back with its dataframe API."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from comparing import Compared
from d2lio.compare import recording
from d2lio.compare.tracks import read_tracks
from d2lio.datasets import open_source

rerun = pytest.importorskip("rerun")
FLOAT32_M = 1e-4  # positions are kept as float32


@pytest.fixture(scope="module")
def columns(compared: Compared, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """Values by column over the timeline; rows without one are left out."""
    file = tmp_path_factory.mktemp("recording") / "compare.rrd"
    recording.write(compared.results, open_source(compared.sequence), file)
    assert [each.name for each in file.parent.iterdir()] == ["compare.rrd"]
    loaded = rerun.dataframe.load_recording(str(file))
    table = loaded.view(index="time", contents="/**").select().read_all()
    found = {name: table.column(name).to_pylist() for name in table.column_names}
    return {name: [value for value in values if value] for name, values in found.items()}


def column(columns: dict[str, list], entity: str, component: str) -> list:
    (name,) = [n for n in columns if n.startswith(f"/{entity}:") and n.endswith(component)]
    return columns[name]


@pytest.mark.parametrize("variant", ["off", "d2"])
def test_every_variant_has_path_cloud_and_plots(
    compared: Compared, columns: dict[str, list], variant: str
) -> None:
    tracks, _ = read_tracks(compared.results)
    track = next(t for t in tracks if t.id == variant)
    places = column(columns, f"world/{variant}/body", "positions")
    shown = np.array([place[0] for place in places])
    assert shown == pytest.approx(track.positions, abs=FLOAT32_M)
    assert len(column(columns, f"world/{variant}/path", "strips")) == len(places) - 1
    clouds = column(columns, f"world/{variant}/cloud", "positions")
    assert len(clouds) > 0.9 * len(places)
    assert min(len(cloud) for cloud in clouds) > 100
    for plot in ("error", "lambda", "rejected", "time"):
        values = column(columns, f"plots/{plot}/{variant}", "scalars")
        assert len(values) > 0.8 * len(places)
        assert np.isfinite([value[0] for value in values]).all()


def test_clouds_lie_on_the_walls_that_the_truth_sees(
    compared: Compared, columns: dict[str, list]
) -> None:
    clouds = [np.array(c) for c in column(columns, "world/off/cloud", "positions")]
    first, last = clouds[2], clouds[-2]
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(first).query(last)
    assert np.median(distance) < 0.5  # m: another pose would put the room elsewhere


def test_the_last_scoreboard_is_the_table(compared: Compared, columns: dict[str, list]) -> None:
    texts = column(columns, "scoreboard", "text")
    assert len(texts) > 3
    for row in compared.results.rows:
        assert f"{row.ate_m:.3f}" in texts[-1][0]


def test_weak_directions_are_those_of_the_diagnostics() -> None:
    row = {"weak_t": "1", "v_t_1_x": "1.0", "v_t_1_y": "0.0", "v_t_1_z": "0.0"}
    assert [v.tolist() for v in recording.weak_directions(row)] == [[1.0, 0.0, 0.0]]
    assert recording.weak_directions({"weak_t": "0"}) == []
    assert recording.weak_directions({}) == []


def test_without_a_display_no_viewer_is_opened(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not recording.open_viewer(tmp_path / "none.rrd")
