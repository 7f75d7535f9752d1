# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The demo in small, and its report in a browser."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from built import WHY_NOT
from d2lio import demo, hosts
from d2lio.cli.commands_demo import _print
from d2lio.report.diagnostics import read_diagnostics
from d2lio.report.figures import MAX_POINTS, SHOWN, thin
from d2lio.report.page import write_report

SCENES = (
    demo.Scene("room", "Room", 6.0),
    demo.Scene("room", "Room <b>", 6.0, ("imu.init_samples=12",), seed=1),
)
VARIANTS = (
    demo.Variant("off", "none"),
    demo.Variant("point_adaptive", "paper"),
    demo.Variant("no_such_mode", "none"),
    *(
        ()
        if WHY_NOT
        else (
            demo.Variant("off", "none", "liosam"),
            demo.Variant("point_adaptive", "paper", "d2lio"),
        )
    ),
)
ROOM_ATE_M = {"fastlio": 0.05, "liosam": 0.15, "d2lio": 0.05}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> demo.DemoResult:
    out = tmp_path_factory.mktemp("demo")
    return demo.run_demo(out, scenes=SCENES, variants=VARIANTS)


def test_a_refused_run_is_a_row_and_the_others_go_on(result: demo.DemoResult) -> None:
    with (result.out / demo.RESULTS_FILE).open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(r["scene"], r["host"], r["rejection"], r["degeneracy"]) for r in rows] == [
        (s.name, v.host, v.rejection, v.degeneracy) for s in SCENES for v in VARIANTS
    ]
    for row in rows:
        if row["rejection"] == "no_such_mode":
            assert row["status"] == "fail"
            assert "rejection.mode" in row["reason"]
            assert row["ate_m"] == ""
        else:
            assert row["status"] == "ok", row
            assert float(row["ate_m"]) < ROOM_ATE_M[row["host"]]
            assert float(row["coverage"]) > 0.95
            assert 0.0 < float(row["accepted_share"]) <= 1.0
            assert (result.out / row["directory"] / "run.json").exists()
    assert len(result.crashed) == len(SCENES)


def test_the_demo_shows_every_host() -> None:
    assert {variant.host for variant in demo.VARIANTS} == set(hosts.HOSTS)
    places = [variant.directory for variant in demo.VARIANTS]
    labels = [variant.label for variant in demo.VARIANTS]
    assert set(SHOWN) < set(demo.VARIANTS)
    assert len(set(places)) == len(set(labels)) == len(demo.VARIANTS)
    groups = [variant.group for variant in demo.VARIANTS]
    assert len(set(groups)) == sum(a != b for a, b in pairwise(["", *groups]))  # each in one piece


def test_without_gtsam_the_rest_is_shown_and_the_note_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(hosts, "LIOSAM_MODULE", "d2lio._no_such_module")
    variants, note = demo.runnable(demo.VARIANTS)
    assert {variant.host for variant in variants} == {"fastlio"}
    assert "D2LIO_GTSAM=on" in note
    result = demo.DemoResult(tmp_path, [], SCENES, variants, note)
    write_report(result, tmp_path / "report.html")
    assert "D2LIO_GTSAM=on" in (tmp_path / "report.html").read_text(encoding="utf-8")
    _print(result)
    assert "left out: the LIO-SAM host" in capsys.readouterr().err


def test_crash_and_divergence_show_as_such(result: demo.DemoResult, tmp_path: Path) -> None:
    good = result.row(SCENES[0], VARIANTS[0])
    assert good is not None
    assert good.evaluation is not None
    ate, share, _ = demo.cell(good)
    assert float(ate) == pytest.approx(good.ate, abs=1e-3)
    assert share.endswith("%")
    lost = demo.Row(SCENES[0], VARIANTS[0], tmp_path)
    lost.evaluation = good.evaluation.model_copy(update={"ate": None, "coverage": 0.4})
    lost.fail("coverage 40 %")
    assert demo.cell(lost)[0] == "- (cov. 40%)"
    crashed = demo.Row(SCENES[0], VARIANTS[0], tmp_path)
    crashed.fail("crashed (SIGSEGV)")
    assert demo.cell(crashed) == ("FAIL", "-", "-")


def test_sequences_are_simulated_once(result: demo.DemoResult) -> None:
    bag = result.out / "sequences" / SCENES[0].directory / "data.bag"
    before = bag.stat().st_mtime_ns
    told: list[str] = []
    demo.ensure_sequence(
        SCENES[0], result.out / "sequences", lambda what, done, total: told.append(what)
    )
    assert bag.stat().st_mtime_ns == before
    assert told == []


def test_an_earlier_run_is_never_scored_again(result: demo.DemoResult, tmp_path: Path) -> None:
    good = result.row(SCENES[0], VARIANTS[0])
    assert good is not None
    place = tmp_path / "runs" / "x"
    shutil.copytree(good.directory, place)
    row = demo.Row(SCENES[0], demo.Variant("no_such_mode", "none"), place)
    sequence = result.out / "sequences" / SCENES[0].directory
    demo._run_row(row, sequence, sequence / "gt.tum", 1)
    assert (row.status, row.record, row.evaluation) == ("fail", None, None)


def test_printed_table_names_every_variant(
    result: demo.DemoResult, capsys: pytest.CaptureFixture[str]
) -> None:
    _print(result)
    printed = capsys.readouterr()
    for variant in VARIANTS:
        assert variant.rejection in printed.out
        assert variant.group in printed.out
    assert "FAST-LIO2 + prior" in printed.out
    assert "ATE [m]" in printed.out
    assert "report.html" in printed.out
    assert "rejection.mode" in printed.err


def test_report_holds_all_it_needs(result: demo.DemoResult) -> None:
    page = (result.out / demo.REPORT_FILE).read_text(encoding="utf-8")
    assert "@@" not in re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r"""(?:src|href)=["'](?:https?:)?//""", markup)
    assert "<b>" not in markup
    assert "Room &lt;b&gt;" in markup
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page)
    assert data is not None
    scenes = json.loads(data.group(1))
    assert [s["id"] for s in scenes] == [s.name for s in SCENES]
    for scene in scenes:
        titles = [figure["layout"]["title"]["text"] for figure in scene["figures"]]
        assert titles[:3] == ["Top view, aligned", "Side view, aligned", "Translation error"]
        assert any("λ_min" in title for title in titles)
        assert all(_drawn(f) for f in scene["figures"] if "λ_min" in f["layout"]["title"]["text"])
        assert "Acceptance radius ε" in titles
        assert scene["params"] in ("", "imu.init_samples=12")
        assert "Correspondences by outcome" in titles
    links = re.findall(r'href="([^"#]+)"', markup)
    assert all((result.out / link).exists() for link in links if not link.startswith("data:"))


def _drawn(figure: dict) -> bool:
    """Whether every curve of the figure is a line and not only single points between gaps."""
    return all(
        any(a is not None and b is not None for a, b in pairwise(curve["y"]))
        for curve in figure["data"]
    )


def test_report_in_a_browser(result: demo.DemoResult, tmp_path: Path) -> None:
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium installed")
    page = (result.out / demo.REPORT_FILE).resolve()
    for width in (1280, 500):
        done = subprocess.run(
            [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-sync",
             "--disable-background-networking", "--disable-component-update",
             f"--user-data-dir={tmp_path / str(width)}", f"--window-size={width},6000",
             "--virtual-time-budget=20000", "--enable-logging=stderr", "--dump-dom",
             f"file://{page}"],
            capture_output=True, text=True, timeout=180, check=True,
            env={**os.environ, "HOME": str(tmp_path)},
        )  # fmt: skip
        assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
        boxes = re.findall(r'class="plot(?: js-plotly-plot)?"', done.stdout)
        assert len(boxes) >= 7 * len(SCENES)
        assert set(boxes) == {'class="plot js-plotly-plot"'}  # every one is drawn


def test_diagnostics_table(tmp_path: Path) -> None:
    file = tmp_path / "d.csv"
    file.write_text("stamp_ns,health,lambda\n1,OK,2.5\n2,LOST,\n3,OK,nan\n")
    columns = read_diagnostics(file)
    assert columns["health"].tolist() == ["OK", "LOST", "OK"]
    assert columns["lambda"][0] == 2.5
    assert np.isnan(columns["lambda"][1:]).all()


def test_curves_are_thinned_and_have_no_nan() -> None:
    values = thin(np.array([1.0 / 3.0, np.nan, np.inf] * 1000))
    assert len(values) <= MAX_POINTS
    assert values[0] == 0.33333
    assert None in values
    json.dumps(values, allow_nan=False)
