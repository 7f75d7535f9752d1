# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Names of variants."""

from __future__ import annotations

import pytest
from d2lio.compare.shared import names
from d2lio.compare.variants import parse, suite_of
from d2lio.errors import ConfigError
from d2lio.hosts import HOSTS, REJECTION_MODES, describe
from d2lio.report import palette


def test_every_mode_is_a_variant_and_d2_is_the_full_one() -> None:
    variants = names.parse(names.DEFAULT)
    assert [v.id for v in variants] == [*REJECTION_MODES, "d2"]
    assert {v.degeneracy for v in variants[:-1]} == {"none"}
    assert (variants[-1].rejection, variants[-1].degeneracy) == (
        "point_adaptive",
        names.DEFAULT_DEGENERACY,
    )
    assert {v.host for v in variants} == {"fastlio"}


def test_the_default_method_is_one_of_the_hosts() -> None:
    allowed = next(e["range"] for e in describe("fastlio") if e["key"] == "degeneracy.method")
    assert names.DEFAULT_DEGENERACY in allowed


def test_hosts_and_colours_are_those_of_the_package() -> None:
    assert set(names.HOSTS) == set(HOSTS)
    assert names.COLOURS == palette.COLOURS
    assert names.TRUTH_COLOUR == palette.TRUTH


def test_a_prefix_chooses_the_host_and_tells_ids_and_titles_apart() -> None:
    own, other, upstream = names.parse("off,liosam:off,upstream:fast_lio")
    assert (own.id, other.id, upstream.id) == ("off", "liosam_off", "upstream_fast_lio")
    assert (own.title, other.title) == ("FAST-LIO2 off", "LIO-SAM off")
    assert upstream.upstream == "fast_lio"
    assert len({own.colour, other.colour, upstream.colour}) == 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("off,turbo", "turbo"),
        ("off,off", "twice"),
        ("", "none given"),
        ("kiss-icp:off", "fastlio, liosam, d2lio"),
        ("upstream:lego", "fast_lio, lio_sam"),
    ],
)
def test_what_cannot_be_used_is_named(text: str, said: str) -> None:
    with pytest.raises(names.VariantError, match=said):
        names.parse(text)


def test_offline_there_are_no_upstream_nodes() -> None:
    with pytest.raises(ConfigError, match="upstream:fast_lio"):
        parse("off,upstream:fast_lio")


def test_the_suite_has_the_variants_in_their_order() -> None:
    from d2lio.ablate.suite import Suite, SuiteSequence

    variants = parse("kiss,off,d2lio:d2")
    suite = suite_of(variants, SuiteSequence(name="x", recording=["x"]))
    assert [v.id for v in suite.variants] == ["kiss", "off", "d2lio_d2"]
    assert suite.variant("d2lio_d2").host == "d2lio"
    import yaml

    assert Suite.parse(yaml.safe_load(suite.to_yaml())) == suite
