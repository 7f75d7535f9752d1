# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The report of an ablation: what it carries, and that it needs nothing else."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from d2lio.ablate.results import Results, load
from d2lio.ablate.suite import Simulate, load_suite
from d2lio.ablate.tables import build
from d2lio.datasets import open_source
from d2lio.metrics.tum import read_tum
from d2lio.report import ablation, cloud, embed, palette, payload
from d2lio.report.printed import SUFFIXES
from d2lio.report.series import RunSeries, align, read_series
from fake_results import PATH_M, VARIANTS, row, suite
from fake_results import ablation as fake_ablation
from fake_results import results as fake_results
from scipy.spatial.transform import Rotation

POSES = 60
RIGID_M = 1e-9
WALL_M = 0.15  # noise of the range and of a scan's placement


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    made = fake_ablation(tmp_path_factory.mktemp("ablation"), poses=POSES)
    ablation.write(made, made.out)
    return made


@pytest.fixture(scope="module")
def page(results: Results) -> str:
    return (results.out / ablation.REPORT_FILE).read_text(encoding="utf-8")


def markup(page: str) -> str:
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def embedded(page: str, name: str) -> dict:
    found = re.search(
        rf'<script type="application/json" id="{name}">(.*?)</script>', page, flags=re.DOTALL
    )
    assert found is not None
    return json.loads(found.group(1))


def test_the_page_needs_nothing_else(page: str, results: Results) -> None:
    body = markup(page)
    assert "@@" not in body
    assert not re.findall(r"""(?:src|href)=["'](?:https?:)?//""", body)
    links = [x for x in re.findall(r'href="([^"#]+)"', body) if not x.startswith("data:")]
    assert len(links) > 10
    assert all((results.out / link).exists() for link in links)


def test_texts_of_others_are_no_markup(tmp_path: Path) -> None:
    nasty = "x </script><b> @@META@@"
    variants = [VARIANTS[0] | {"title": nasty}, *VARIANTS[1:]]
    rows = [row("Tunnel-2", 1, "fastlio", None, reason=nasty)]
    made = fake_results(rows, tmp_path, title=nasty, description=nasty, variants=variants)
    made.notes.append(nasty)
    text = ablation.write(made, tmp_path).read_text(encoding="utf-8")
    assert "<b> @@" not in markup(text)
    assert "x &lt;/script&gt;&lt;b&gt; @@META@@" in markup(text)
    meta = embedded(text, "meta")
    assert (meta["variants"][0]["title"], meta["runs"][0]["reason"]) == (nasty, nasty)


def test_every_run_is_there_with_its_files(page: str, results: Results) -> None:
    meta = embedded(page, "meta")
    assert len(meta["runs"]) == len(results.rows)
    for run, given in zip(meta["runs"], results.rows, strict=True):
        files = [meta["files"][k] for k in run["files"]]
        assert all((results.out / run["directory"] / name).exists() for name in files)
        assert ("trajectory.tum" in files) == (given.ate_m is not None)
        assert (run["reason"] == "") == (given.status == "ok")
        assert results.suite.variants[run["variant"]].id == given.variant


def test_curves_survive_their_packing(page: str, results: Results) -> None:
    data = embedded(page, "sequence-0")
    assert set(data["repeats"]) == {"0", "1", "2", "3", "4"}
    given = read_series(results.out / results.rows[0].directory)
    curves = data["repeats"]["0"]["runs"]["0"]
    assert embed.unpack(curves["x"]) == pytest.approx(given.path[:, 0], abs=PATH_M / 65000)
    assert embed.unpack(curves["e"]) == pytest.approx(given.error, rel=1e-3)
    assert embed.unpack(curves["lt"]) == pytest.approx(given.lambda_t, rel=1e-3)
    assert curves["o"][0] == pytest.approx(0.8)  # accepted of offered
    assert curves["b"] == pytest.approx([0.05, 0.2, 0.3, 0.6, None, None])
    assert len(embed.unpack(data["map"]["x"])) == cloud.POINTS


def test_one_colour_per_variant(page: str) -> None:
    looks = [(v["colour"], v["dash"]) for v in embedded(page, "meta")["variants"]]
    assert looks == [(palette.style(i).colour, "solid") for i in range(len(VARIANTS))]
    many = {(palette.style(i).colour, palette.style(i).dash) for i in range(24)}
    assert len(many) == 24


def test_some_variants_of_every_sequence_are_shown_at_first(tmp_path: Path) -> None:
    groups = ("A", "B")
    variants = [
        {"id": f"{g}{k}", "title": f"w = {k}", "group": g, "host": "fastlio"}
        for g in groups
        for k in range(8)
    ]
    sequences = [{"name": g, "groups": [g], "simulate": {"scene": "room"}} for g in groups]
    rows = [row(g, 0, f"{g}{k}", 0.1) for g in groups for k in range(8)]
    made = fake_results(rows, tmp_path, variants=variants, sequences=sequences, baseline="A0",
                        layout={"blocks": "group"}, paper=None)  # fmt: skip
    meta = payload.meta(made, build(made))
    shown = [v["title"] for v in meta["variants"] if v["shown"]]
    assert shown == [f"{g}: w = {k}" for g in groups for k in range(payload.SHOWN)]
    assert meta["baseline"] == "A: w = 0 or B: w = 0"


def test_the_command_is_that_of_the_shipped_suite_where_it_is(tmp_path: Path) -> None:
    made = fake_results([row("Tunnel-2", 0, "fastlio", 0.1)], tmp_path)
    assert "d2lio ablate suite.yaml" in ablation.write(made, tmp_path).read_text(encoding="utf-8")
    made.suite = load_suite("smoke")
    made.rows = [row("Room", 0, "fastlio", 0.1)]
    assert "d2lio ablate smoke<" in ablation.write(made, tmp_path).read_text(encoding="utf-8")


def test_timing_and_differences(page: str, results: Results) -> None:
    meta = embedded(page, "meta")
    assert meta["stages"] == ["preprocess", "deskew", "search", "update", "map"]
    assert len(meta["timing"][0]["box"]) == 15
    assert meta["timing"][3]["stages"] is None  # an imported trajectory has none
    ratios = {(s, v): ratio for s, v, ratio, _, _ in meta["differences"]}
    assert set(ratios) == {(s, v) for s in range(3) for v in (1, 2, 3)}
    assert all(ratios[s, 2] < 1.0 < ratios[s, 1] for s in range(3))
    assert all(low < ratio < high for *_, ratio, low, high in meta["differences"])


def test_figures_and_tables_are_files_too(results: Results) -> None:
    figures = {f.name for f in (results.out / "figures").iterdir()}
    names = ("trajectories_top", "trajectories_side", "error", "lambda_min_translation",
             "lambda_min_rotation", "ate", "timing")  # fmt: skip
    assert figures == {name + suffix for name in names for suffix in SUFFIXES}
    assert all((results.out / "figures" / name).stat().st_size > 1000 for name in figures)
    assert {f.name for f in (results.out / "tables").iterdir()} == {
        "fake.md", "fake.tex", "fake.csv"
    }  # fmt: skip


def test_the_report_comes_from_the_files_alone(results: Results) -> None:
    read = load(results.out)
    assert read.rows == results.rows
    assert read.timings.keys() == results.timings.keys()
    assert read.suite == results.suite


def test_a_suite_may_do_without_figures(tmp_path: Path) -> None:
    plan = suite(repeats=1, figures={"trajectories": False, "lambda_min": False})
    made = fake_ablation(tmp_path, plan, poses=POSES)
    ablation.write(made, tmp_path)
    assert {f.stem for f in (tmp_path / "figures").iterdir()} == {"ate", "timing"}


def test_an_ablation_in_which_everything_crashed(tmp_path: Path) -> None:
    rows = [row("Tunnel-2", k, "fastlio", None) for k in range(2)]
    made = fake_results(rows, tmp_path)
    text = ablation.write(made, tmp_path).read_text(encoding="utf-8")
    assert embedded(text, "sequence-0") == {"repeats": {}}
    assert "Failures (2)" in text


def test_points_are_fewer_for_more_runs() -> None:
    assert payload.points_per_curve(1) == payload.MAX_POINTS
    assert payload.MIN_POINTS < payload.points_per_curve(1000) < payload.MAX_POINTS
    assert payload.points_per_curve(10**6) == payload.MIN_POINTS
    assert 1000 * payload.points_per_curve(1000) * payload.BYTES_PER_POINT <= payload.CURVES_BYTES


def test_packing_keeps_gaps_and_refuses_nothing() -> None:
    values = np.array([1.0, np.nan, -2.0, np.inf, 5.0])
    back = embed.unpack(embed.pack(values))
    assert np.isnan(back).tolist() == [False, True, False, True, False]
    assert back[[0, 2, 4]] == pytest.approx([1.0, -2.0, 5.0], abs=7.0 / 65000)
    assert embed.pack(np.array([np.nan])) is None
    assert embed.pack(np.empty(0)) is None
    assert embed.unpack(embed.pack(np.full(3, 7.0))).tolist() == [7.0] * 3
    logs = embed.unpack(embed.pack(np.array([1e-9, 0.0, 1e6]), log=True))
    assert logs[[0, 2]] == pytest.approx([1e-9, 1e6], rel=1e-3)
    assert np.isnan(logs[1])


def test_filling_a_template_leaves_values_alone() -> None:
    assert embed.fill("a @@A@@ b", {"A": "@@B@@ $&"}) == "a @@B@@ $& b"
    with pytest.raises(KeyError):
        embed.fill("@@NOBODY@@", {})


def moved_back(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    R, t = align(points, target)
    assert np.linalg.det(R) == pytest.approx(1.0)
    return points @ R.T + t


def test_alignment_undoes_a_rigid_motion() -> None:
    rng = np.random.default_rng(2)
    target = rng.normal(size=(30, 3))
    moved = Rotation.random(random_state=3).apply(target) + np.array([5.0, -2.0, 1.0])
    assert moved_back(moved, target) == pytest.approx(target, abs=RIGID_M)
    flat = target * [1.0, 1.0, 0.0]  # a mirrored solution would be as near here
    turned = Rotation.from_euler("x", 180, degrees=True).apply(flat)
    assert moved_back(turned, flat) == pytest.approx(flat, abs=RIGID_M)


def test_a_run_that_stands_still_starts_with_the_truth(tmp_path: Path) -> None:
    turned = "0 0 0.7071067811865476 0.7071067811865476"  # the estimate's map is turned by 90 deg
    times = range(10)
    truth = "".join(f"{k} {k} 0 1 0 0 0 1\n" for k in times)
    estimate = "".join(f"{k} 7 {min(k, 3)} 0 {turned}\n" for k in times)
    (tmp_path / "truth.tum").write_text(truth)
    (tmp_path / "trajectory.tum").write_text(estimate)
    series = read_series(tmp_path)
    assert series.restart is not None
    R, t = series.restart
    expected = [[min(k, 3), 0.0, 1.0] for k in times]
    assert series.path @ R.T + t == pytest.approx(np.array(expected), abs=RIGID_M)
    assert series.path.mean(axis=0) == pytest.approx([4.5, 0.0, 1.0])  # as a whole: in the middle
    (tmp_path / "truth.tum").write_text(truth.replace("0 0 0 1\n", "0 0 0 0\n"))
    assert read_series(tmp_path).restart is None  # no attitudes


def test_a_run_that_left_little_gives_few_curves(tmp_path: Path) -> None:
    def empty(series: RunSeries) -> bool:
        return not any(map(len, (series.t, series.path, series.lambda_t, series.shares)))

    assert empty(read_series(tmp_path))
    (tmp_path / "truth.tum").write_text("1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n3 2 0 0 0 0 0 1\n")
    assert empty(read_series(tmp_path))
    assert len(read_series(tmp_path).truth) == 3
    (tmp_path / "trajectory.tum").write_text("1 nan 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n")
    (tmp_path / "diagnostics.csv").write_text("stamp_ns,status\n1,ok,too many\n")
    assert empty(read_series(tmp_path))
    (tmp_path / "diagnostics.csv").write_text("stamp_ns,status,time_total_ms\n1000000000,ok,3\n")
    assert read_series(tmp_path).t_scan.tolist() == [0.0]  # as a package beside ours leaves it


def test_skipped_scans_are_no_gap(tmp_path: Path) -> None:
    (tmp_path / "truth.tum").write_text("1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n")
    lines = ["stamp_ns,status,lambda_t_1,lambda_r_1", "1000000000,ok,5,6",
             "1100000000,skipped,nan,nan", "1200000000,ok,7,8"]  # fmt: skip
    (tmp_path / "diagnostics.csv").write_text("\n".join(lines) + "\n")
    series = read_series(tmp_path)
    assert series.lambda_t.tolist() == [5.0, 7.0]
    assert series.t_scan == pytest.approx([0.0, 0.2])


def test_the_map_of_a_scene_and_of_its_scans_agree(room: Path, tmp_path: Path) -> None:
    source = open_source(room)
    file = cloud.map_file(tmp_path, "Room 1")
    assert file.name == "Room_1.npy"
    truth = room / "gt.tum"
    assert cloud.save_map(source, truth, file, scans=10) > 1000
    scans = np.load(file)
    what = Simulate(scene="room", duration=4.0)
    scene = cloud.scene_map(what, 0, read_tum(truth).positions)
    for axis in (0, 1):  # walls: both see the same room
        for share in (1, 99):
            assert np.percentile(scans[:, axis], share) == pytest.approx(
                np.percentile(scene[:, axis], share), abs=WALL_M
            )


def test_a_saved_map_is_preferred(tmp_path: Path) -> None:
    sequence = suite().sequences[0]
    file = cloud.map_file(tmp_path, sequence.name)
    file.parent.mkdir()
    np.save(file, np.ones((5, 3), np.float32))
    assert cloud.load_map(tmp_path, sequence, 0, np.zeros((2, 3))).shape == (5, 3)
    recorded = sequence.model_copy(update={"name": "other", "simulate": None})
    assert cloud.load_map(tmp_path, recorded, 0, np.zeros((2, 3))).shape == (0, 3)


def test_a_truth_is_that_of_its_own_run(tmp_path: Path) -> None:
    places = [tmp_path / name for name in ("a", "b", "c")]
    for place, x in zip(places, (1, 1, 2), strict=True):
        place.mkdir()
        if place.name == "b":
            (place / "truth.tum").hardlink_to(tmp_path / "a/truth.tum")
        else:
            (place / "truth.tum").write_text(f"1 {x} 0 0 0 0 0 1\n")
    found = [read_series(place).truth[0, 0] for place in (*places, places[0])]
    assert found == [1.0, 1.0, 2.0, 1.0]
