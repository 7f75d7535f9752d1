# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Environments of peers: whole or not there; what the command says. pip is played by a function."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from d2lio.cli import app
from d2lio.errors import DataError
from d2lio.peers import PEERS, environments
from typer.testing import CliRunner

KISS = PEERS["kiss-icp"]
MAD = PEERS["mad-icp"]


class FakePip:
    """Stands in for venv and pip; fails where `fail_on` stands in the command."""

    def __init__(self) -> None:
        self.commands: list[list[str]] = []
        self.extra: list[dict[str, str]] = []
        self.constraints: list[str] = []
        self.fail_on = ""
        self.error: type[BaseException] = DataError

    def __call__(self, command: list[str], peer, extra: dict[str, str]) -> str:
        self.commands.append(command)
        self.extra.append(extra)
        self.constraints += [Path(path).read_text() for path in extra.values()]
        if self.fail_on and self.fail_on in command:
            raise self.error(f"no {self.fail_on}")
        if "venv" in command:
            python = Path(command[-1]) / "bin" / "python"
            python.parent.mkdir(parents=True)
            python.touch()
        return "numpy==2.0\n" if "freeze" in command else ""


@pytest.fixture
def pip(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakePip:
    fake = FakePip()
    monkeypatch.setattr(environments, "_run", fake)
    monkeypatch.setenv("D2LIO_PEERS", str(tmp_path))
    for peer in PEERS.values():
        monkeypatch.delenv(environments.override_variable(peer), raising=False)
    return fake


def test_installed_once_with_its_pins(pip: FakePip, tmp_path: Path) -> None:
    assert not environments.installed(KISS)
    assert environments.install(KISS)
    assert environments.installed(KISS)
    assert pip.commands[1][-2:] == ["kiss-icp==1.3.0", "numpy>=1.26"]
    assert environments.interpreter(KISS) == tmp_path / "kiss-icp" / "bin" / "python"
    done = len(pip.commands)
    assert not environments.install(KISS)
    assert len(pip.commands) == done
    manifest = json.loads((tmp_path / "kiss-icp" / environments.MANIFEST).read_text())
    assert manifest["packages"] == ["numpy==2.0"]


def test_other_pins_make_it_stale(pip: FakePip) -> None:
    environments.install(KISS)
    newer = replace(KISS, version="99.0")
    assert not environments.installed(newer)
    assert environments.install(newer)
    assert environments.installed(newer)
    assert not environments.installed(KISS)


@pytest.mark.parametrize("error", [DataError, KeyboardInterrupt])
@pytest.mark.parametrize("at", ["venv", "install", "freeze"])
def test_a_failure_leaves_nothing_that_counts(
    pip: FakePip, tmp_path: Path, at: str, error: type[BaseException]
) -> None:
    pip.fail_on, pip.error = at, error
    with pytest.raises(error):
        environments.install(KISS)
    assert not environments.installed(KISS)
    assert not (tmp_path / "kiss-icp").exists()
    pip.fail_on = ""
    assert environments.install(KISS)


def test_killed_before_the_manifest_it_is_not_whole(pip: FakePip, tmp_path: Path) -> None:
    environments.install(KISS)
    (tmp_path / "kiss-icp" / environments.MANIFEST).unlink()
    stray = tmp_path / "kiss-icp" / "stray"
    stray.touch()
    with pytest.raises(DataError, match="d2lio peers install kiss-icp"):
        environments.interpreter(KISS)
    assert environments.install(KISS)
    assert not stray.exists()


def test_what_mad_icp_is_built_with_is_held_back(pip: FakePip) -> None:
    environments.install(MAD)
    assert set(pip.constraints) == {"scikit-build-core<0.10\n"}
    assert {"PIP_CONSTRAINT", "PIP_BUILD_CONSTRAINT"} == set(pip.extra[1])
    alone, together = pip.commands[1:3]
    assert alone[-2:] == ["--no-deps", "mad-icp==0.0.10"]
    assert together[-2:] == ["--quiet", "numpy>=1.26"]
    environments.install(KISS)
    assert pip.extra[-1] == pip.extra[-2] == {}


def test_peers_that_share_an_environment_come_and_go_together(pip: FakePip) -> None:
    environments.install(PEERS["evalio-dlio"])
    assert environments.installed(PEERS["evalio-liosam"])
    gone = environments.remove(PEERS["evalio-ct"])
    assert gone == ["evalio-liosam", "evalio-dlio", "evalio-loam", "evalio-ct"]
    assert not environments.installed(PEERS["evalio-dlio"])
    assert environments.remove(PEERS["evalio-ct"]) == []


def test_the_place_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("D2LIO_PEERS", "")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert environments.root() == tmp_path / "d2lio" / "peers"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert environments.root() == tmp_path / ".local" / "share" / "d2lio" / "peers"


def test_the_commands(pip: FakePip, tmp_path: Path) -> None:
    runner = CliRunner()
    rows = json.loads(runner.invoke(app, ["peers", "list", "--json"]).stdout)
    assert [row["name"] for row in rows] == list(PEERS)
    assert not any(row["installed"] for row in rows)
    assert runner.invoke(app, ["peers", "install", "kiss-icp", "evalio-dlio"]).exit_code == 0
    rows = json.loads(runner.invoke(app, ["peers", "list", "--json"]).stdout)
    installed = {row["name"] for row in rows if row["installed"]}
    assert installed == {"kiss-icp", "evalio-liosam", "evalio-dlio", "evalio-loam", "evalio-ct"}
    result = runner.invoke(app, ["peers", "list"])
    assert "GPL-2.0-only" in result.output
    result = runner.invoke(app, ["peers", "remove", "all"])
    assert "kiss-icp, evalio-liosam" in result.output
    assert runner.invoke(app, ["peers", "remove", "kiss"]).exit_code == 2


def test_one_that_fails_does_not_keep_the_others_from_it(pip: FakePip, tmp_path: Path) -> None:
    pip.fail_on = "mad-icp==0.0.10"
    elsewhere = tmp_path / "elsewhere"
    arguments = ["peers", "install", "all", "--into", str(elsewhere)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 3
    assert "no mad-icp==0.0.10" in result.output
    missing = {name for name, peer in PEERS.items() if not environments.installed(peer, elsewhere)}
    assert missing == {"mad-icp"}


def test_pips_last_words_are_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    nonsense = replace(KISS, package="", version="", requirements=())
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(DataError, match=r"kiss-icp could not be installed: .*Invalid requirement"):
        environments.install(nonsense, tmp_path)
