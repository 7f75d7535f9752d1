# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Suites: what is refused and how it is said, the shipped ones, reduction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tiny
import yaml
from d2lio.ablate.suite import SHIPPED, Suite, load_suite, shipped, slug
from d2lio.ablate.tables import paper_table
from d2lio.datasets.catalog import datasets
from d2lio.errors import ConfigError, DataError
from d2lio.hosts import HOSTS, REJECTION_MODES
from d2lio.peers import PEERS


def refused(changes: dict[str, Any]) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        Suite.parse(tiny.data(**changes), "my.yaml")
    assert "my.yaml" in str(caught.value)
    return caught.value


def test_unknown_keys_are_named_with_the_known_ones() -> None:
    error = refused({"repeat": 3})
    assert (error.key, error.value) == ("repeat", 3)
    assert "repeats" in error.allowed
    bad = {"name": "a", "simulate": {"scene": "room", "length": 3}}
    error = refused({"sequences": [bad]})
    assert error.key == "sequences.0.simulate.length"
    assert "duration" in error.allowed
    assert "repeats" not in error.allowed


@pytest.mark.parametrize(
    ("changes", "key", "allowed"),
    [
        ({"repeats": 0}, "repeats", "greater than or equal to 1"),
        ({"baseline": "kiss"}, "suite", "fastlio, adaptive"),
        ({"limits": {"time_s": -1}}, "limits.time_s", "greater than 0"),
        ({"layout": {"rows": "variant"}}, "layout", "differ"),
        ({"sequences": []}, "sequences", "at least 1 item"),
        ({"sequences": [{"name": "a"}]}, "sequences.0", "`simulate`, `recording` or both"),
        (
            {"sequences": [{"name": "a", "simulate": {"scene": "rom"}}]},
            "sequences.0.simulate.scene",
            "room",
        ),
        ({"variants": [{"id": "a"}]}, "variants.0", "either `host` or `import`"),
        ({"variants": [{"id": "a/b", "host": "fastlio"}]}, "variants.0.id", "pattern"),
        ({"variants": [{"id": "..", "host": "fastlio"}]}, "variants.0.id", "pattern"),
        ({"variants": [tiny.FASTLIO, tiny.FASTLIO]}, "suite", "fastlio stands there twice"),
        ({"name": "../up"}, "name", "pattern"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, Any], key: str, allowed: str) -> None:
    error = refused(changes)
    assert error.key == key
    assert allowed in error.allowed


def test_names_that_share_a_directory_are_refused() -> None:
    same = [{"name": name, "simulate": tiny.ROOM} for name in ("A b", "a_B")]
    assert slug("A b").lower() == slug("a_B").lower()
    assert "a_b stands there twice" in refused({"sequences": same}).allowed


def test_not_yaml_and_not_there(tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    file.write_text("name: [")
    with pytest.raises(DataError, match="cannot be read"):
        Suite.load(file)
    with pytest.raises(DataError, match="no such file"):
        Suite.load(tmp_path / "t.yaml")
    with pytest.raises(ConfigError, match="table1"):
        load_suite("tabel1")
    file.write_text("5\n")
    with pytest.raises(ConfigError, match="suite = 5"):
        load_suite(str(file))


def test_yaml_off_and_numbers_are_texts() -> None:
    text = "{id: a, host: fastlio, rejection: off, params: {degeneracy.w: 30, x: true}}"
    variants = [tiny.FASTLIO, yaml.safe_load(text)]
    variant = tiny.suite(variants=variants).variant("a")
    assert variant.rejection == "off"
    assert variant.params == {"degeneracy.w": "30", "x": "true"}


@pytest.mark.parametrize("name", sorted(shipped()))
def test_written_and_read_again_it_is_the_same(name: str) -> None:
    suite = load_suite(name)
    assert suite.name == name
    assert Suite.parse(yaml.safe_load(suite.to_yaml())) == suite


def test_the_promised_suites_are_shipped() -> None:
    assert set(shipped()) >= {"table1", "table2", "eigenvalues", "degeneracy", "smoke"}
    assert all(file.parent == SHIPPED for file in shipped().values())


@pytest.mark.parametrize("name", sorted(shipped()))
def test_shipped_suites_name_what_there_is(name: str) -> None:
    suite = load_suite(name)
    known = {s.name for dataset in datasets().values() for s in dataset.sequences}
    for sequence in suite.sequences:
        assert set(sequence.recording) <= known
        assert sequence.simulate is not None
    for variant in suite.variants:
        assert variant.import_ or variant.host in HOSTS or variant.host in PEERS
        assert variant.rejection in (None, *REJECTION_MODES)
        assert variant.degeneracy in (
            None,
            "none",
            "paper",
            "remap",
            "tsvd",
            "xicp",
            "noise_aware",
        )


@pytest.mark.parametrize(("name", "repeats"), [("table1", 5), ("table2", 5)])
def test_tables_have_the_papers_rows_and_columns(name: str, repeats: int) -> None:
    suite = load_suite(name)
    assert suite.paper is not None
    assert suite.repeats >= repeats
    lines = paper_table(suite.paper.table)
    assert [s.name for s in suite.sequences] == [line["sequence"] for line in lines]
    assert [s.dataset for s in suite.sequences] == [line["dataset"] for line in lines]
    figures = set(lines[0]) - {"host", "dataset", "sequence"}
    assert set(suite.paper.columns.values()) == figures


def test_table1_runs_each_host_on_its_own_sequences() -> None:
    suite = load_suite("table1")
    assert suite.paper is not None
    for line in paper_table(suite.paper.table):
        variants = suite.variants_of(suite.sequence(line["sequence"]))
        assert {v.group for v in variants} == {line["host"]}
        assert [v.rejection for v in variants] == list(REJECTION_MODES)
        assert {v.degeneracy for v in variants} == {"none"}


def test_no_two_sequences_of_a_suite_are_the_same() -> None:
    for name in shipped():
        suite = load_suite(name)
        made = [
            (s.simulate.scene, s.simulate.sensor, s.simulate.imu, seed)
            for s in suite.sequences
            if s.simulate is not None
            for seed in range(s.simulate.seed_base, s.simulate.seed_base + suite.repeats)
        ]
        assert len(set(made)) == len(made), name


def test_reduced_keeps_the_order_and_drops_what_hangs_on_it() -> None:
    suite = load_suite("table1").reduced(
        repeats=1,
        sequences=["Offroad6_beta", "Offroad2_beta"],
        variants=["fastlio-kiss", "fastlio-off"],
    )
    assert [s.name for s in suite.sequences] == ["Offroad2_beta", "Offroad6_beta"]
    assert [v.id for v in suite.variants] == ["fastlio-off", "fastlio-kiss"]
    assert suite.repeats == 1
    assert suite.baseline is None
    assert suite.paper is not None
    assert suite.paper.columns == {"fastlio-kiss": "kiss"}


def test_reduced_drops_sequences_without_variants() -> None:
    suite = load_suite("table1").reduced(variants=["liosam-none"])
    assert {s.dataset for s in suite.sequences} == {"ECMD"}


@pytest.mark.parametrize("option", ["variants", "sequences"])
def test_reduced_refuses_unknown_names(option: str) -> None:
    with pytest.raises(ConfigError, match=f"--only-{option} = 'nobody'"):
        tiny.suite().reduced(**{option: ["nobody"]})
