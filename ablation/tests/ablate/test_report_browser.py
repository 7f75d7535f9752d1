# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The report of an ablation in headless Chromium, from a file and without a network.

Needs `chromium` and `chromedriver` on PATH, which `./d2lio test` installs; D2LIO_SKIP_BROWSER=1
leaves these tests out.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from d2lio.report import ablation
from fake_results import ablation as fake_ablation
from fake_results import suite

SKIP = "D2LIO_SKIP_BROWSER"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WAIT_S = 60.0  # a machine under load; every wait ends as soon as what it waits for is there
PHONE = 360
FIRST_M = 2e-3  # steps of packed curves
DESKTOP = 1280
ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-background-networking",
    "--disable-component-update", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card, for the 3-D view
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network
)  # fmt: skip

pytestmark = pytest.mark.skipif(os.environ.get(SKIP) == "1", reason=f"{SKIP}=1")


def program(*names: str) -> str:
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.fail(
            f"no {' or '.join(names)} on PATH: install Debian's chromium and chromium-driver "
            f"(`./d2lio test` does), or set {SKIP}=1"
        )
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("ablation")
    plan = suite(figures={"trajectories": False, "lambda_min": False})  # as files, that is
    return ablation.write(fake_ablation(out, plan, poses=120), out).resolve()


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = program(*BROWSERS)
    for argument in (*ARGUMENTS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    found = webdriver.Chrome(options=options, service=Service(program("chromedriver")))
    found.set_page_load_timeout(WAIT_S)
    yield found
    found.quit()


@pytest.fixture
def visit(driver: Any, page: Path) -> Iterator[Callable[[int], Any]]:
    """Opens the page anew in a window of that width; fails on errors on the console."""

    def go(width: int = DESKTOP) -> Any:
        metrics = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 700}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        driver.get(page.as_uri())
        return driver

    driver.get_log("browser")
    yield go
    severe = [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]
    assert severe == []


def until(driver: Any, script: str, *arguments: Any) -> Any:
    """What a JavaScript expression gives as soon as that is true."""
    from selenium.webdriver.support.ui import WebDriverWait

    def value(d: Any) -> Any:
        return d.execute_script(f"return {script}", *arguments)

    return WebDriverWait(driver, WAIT_S).until(value, message=script)


def rows(driver: Any) -> list[str]:
    return driver.execute_script(
        "return [...document.querySelectorAll('.results tbody tr')]"
        ".filter((r) => r.offsetParent).map((r) => r.cells[0].textContent)"
    )


def columns(driver: Any) -> list[str]:
    return driver.execute_script(
        "return [...document.querySelectorAll('.results thead th')]"
        ".filter((r) => r.offsetParent).map((r) => r.textContent)"
    )


def click_header(driver: Any, title: str) -> None:
    driver.find_element("xpath", f"//thead//button[text()='{title}']").click()


SEQUENCES = ["Tunnel-2", "Flat Ground", "Highway_day_easy_a"]
POOLED = ["difference to FAST-LIO2", "all sequences"]
AS_MADE = ["GEODE", "Tunnel-2", "Flat Ground", "ECMD", "Highway_day_easy_a", *POOLED]
VARIANTS = ["FAST-LIO2", "LIO-SAM", "D²-LIO", "VoxelMap"]


def test_a_click_on_a_header_sorts(visit: Callable[..., Any]) -> None:
    driver = visit()
    assert rows(driver) == AS_MADE
    click_header(driver, "D²-LIO")
    assert rows(driver) == [*SEQUENCES, *POOLED]  # the made-up errors grow
    click_header(driver, "D²-LIO")
    assert rows(driver) == [*reversed(SEQUENCES), *POOLED]
    click_header(driver, "D²-LIO")
    assert rows(driver) == AS_MADE
    click_header(driver, "LIO-SAM")
    click_header(driver, "LIO-SAM")
    assert rows(driver)[:3] == ["Highway_day_easy_a", "Tunnel-2", "Flat Ground"]  # `-` is last
    click_header(driver, "sequence")
    assert rows(driver)[:3] == sorted(SEQUENCES)


def test_typing_filters(visit: Callable[..., Any]) -> None:
    driver = visit()
    field = driver.find_element("id", "filter")
    field.send_keys("tunn")
    assert rows(driver) == ["GEODE", "Tunnel-2"]
    assert columns(driver) == ["sequence", *VARIANTS]
    field.clear()
    field.send_keys("voxel")
    assert rows(driver) == AS_MADE
    assert columns(driver) == ["sequence", "VoxelMap"]
    field.clear()
    field.send_keys("nothing of that name")
    assert rows(driver) == []
    assert driver.find_element("id", "nothing").is_displayed()


def test_data_sets_and_hosts_filter(visit: Callable[..., Any]) -> None:
    from selenium.webdriver.support.ui import Select

    driver = visit()
    Select(driver.find_element("id", "dataset")).select_by_visible_text("ECMD")
    assert rows(driver)[:2] == ["ECMD", "Highway_day_easy_a"]
    assert "Tunnel-2" not in rows(driver)
    Select(driver.find_element("id", "host")).select_by_visible_text("LIO-SAM")
    assert columns(driver) == ["sequence", "LIO-SAM"]


def test_a_tooltip_tells_what_lies_behind_a_cell(visit: Callable[..., Any]) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    driver = visit()
    tip = driver.find_element("id", "tip")
    assert not tip.is_displayed()
    cell = driver.find_element("xpath", "//tr[th='Flat Ground']/td[2]")
    ActionChains(driver).move_to_element(cell).perform()
    assert tip.is_displayed()
    for said in ("n = 5, failed 5", "crashed (SIGSEGV)", "to the baseline", "%"):
        assert said in tip.text
    ActionChains(driver).move_to_element(driver.find_element("tag name", "h1")).perform()
    assert not tip.is_displayed()
    driver.execute_script("arguments[0].focus()", cell)  # without a mouse
    assert tip.is_displayed()


@pytest.mark.parametrize("width", [DESKTOP, PHONE])
def test_every_section_draws_its_figures(visit: Callable[..., Any], width: int) -> None:
    driver = visit(width)
    sections = driver.find_elements("css selector", "details.section")
    assert len(sections) == 10
    for section in sections:
        driver.execute_script(
            "document.querySelectorAll('details.section').forEach((d) => { d.open = false; });"
            "arguments[0].open = true; arguments[0].scrollIntoView();",
            section,
        )
        for box in section.find_elements("css selector", ".plot"):
            name = box.get_attribute("data-figure")
            driver.execute_script("arguments[0].scrollIntoView()", box)
            drawn = "arguments[0].querySelector('.main-svg, canvas') && arguments[0].data.length"
            assert until(driver, drawn, box) >= 2, name
            assert box.size["width"] <= width
    for name in ("failures", "files"):
        filled = f"document.querySelectorAll('[data-list={name}] tbody tr').length"
        driver.execute_script(f"document.getElementById('{name}').open = true")
        assert until(driver, filled) >= 4


def test_curves_are_those_of_the_choice(visit: Callable[..., Any]) -> None:
    from selenium.webdriver.support.ui import Select

    driver = visit()
    driver.execute_script("document.getElementById('errors').scrollIntoView()")
    names = "document.querySelector('[data-figure=error]').data?.map((trace) => trace.name)"
    assert until(driver, names) == VARIANTS
    first = "document.querySelector('[data-figure=error]').data[0].y[5]"
    before = until(driver, first)
    Select(driver.find_element("id", "repeat")).select_by_visible_text("repeat 2")
    until(driver, f"{first} !== {before}")
    Select(driver.find_element("id", "sequence")).select_by_visible_text("Flat Ground")
    until(driver, f"({names}).length === 3")  # LIO-SAM crashed there
    driver.find_element("xpath", "//*[@id='chips']/button[contains(., 'D²-LIO')]").click()
    until(driver, f"({names}).join() === 'FAST-LIO2,VoxelMap'")


def test_paths_can_be_aligned_at_their_start(visit: Callable[..., Any]) -> None:
    from selenium.webdriver.support.ui import Select

    driver = visit()
    driver.execute_script("document.getElementById('trajectories').scrollIntoView()")
    first = "document.querySelector('[data-figure=top]').data?.map((trace) => trace.y[0])"
    truth, *before = until(driver, first)
    assert max(abs(y - truth) for y in before) > FIRST_M
    Select(driver.find_element("id", "align")).select_by_value("start")
    until(driver, f"({first})[1] !== {before[0]}")
    truth, *after = until(driver, first)
    assert after == pytest.approx([truth] * len(after), abs=FIRST_M)


def test_a_phone_scrolls_tables_in_their_box_and_not_the_page(visit: Callable[..., Any]) -> None:
    driver = visit(PHONE)
    driver.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    until(driver, "document.querySelectorAll('[data-list=files] tbody tr').length")
    assert driver.execute_script("return innerWidth") == PHONE
    assert driver.execute_script("return document.documentElement.scrollWidth") <= PHONE
    assert driver.execute_script("return document.body.scrollWidth") <= PHONE
    box = driver.find_element("css selector", ".block .scroll")
    assert driver.execute_script("return arguments[0].scrollWidth", box) > PHONE
    first = driver.find_element("xpath", "//tr/th[.='Tunnel-2']")
    driver.execute_script("arguments[0].scrollLeft = 200", box)
    assert first.rect["x"] >= 0  # the first column stays
