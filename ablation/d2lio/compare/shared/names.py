# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the names given to `--variants` and `variants:=` mean."""

from __future__ import annotations

from typing import NamedTuple

MODES = ("off", "none", "fixed", "kiss", "point_adaptive")
FULL = "d2"
FULL_MODE = "point_adaptive"
DEFAULT_DEGENERACY = "noise_aware"  # the project's default method: what `d2` adds to FULL_MODE
HOSTS = ("fastlio", "liosam", "d2lio")
HOST_TITLES = {"fastlio": "FAST-LIO2", "liosam": "LIO-SAM", "d2lio": "D²-LIO"}
UPSTREAM_HOST = "upstream"
UPSTREAMS = {"fast_lio": "FAST_LIO (upstream)", "lio_sam": "LIO-SAM (upstream)"}
ALL = (*MODES, FULL)
DEFAULT = ",".join(ALL)

# Those of d2lio.report.palette, in its order.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
TRUTH_COLOUR = "#9a9a9a"


class VariantError(ValueError):
    """A list of variants that cannot be used; says which name and what is allowed."""


class Variant(NamedTuple):
    """One line of the scoreboard.

    Attributes:
        id: name of directories and of the ROS namespace.
        host: fastlio, liosam or d2lio; empty for an upstream node.
        rejection, degeneracy: empty for an upstream node, whose own configuration says that.
        upstream: its ROS package, fast_lio or lio_sam; else empty.
        colour: #rrggbb.
    """

    id: str
    title: str
    host: str
    rejection: str
    degeneracy: str
    upstream: str
    colour: str


def parse(text: str, host: str = "fastlio", upstream: bool = True) -> list[Variant]:
    """Variants out of `off,none,liosam:d2,upstream:fast_lio`.

    Args:
        host: of names without `HOST:`.
        upstream: whether upstream nodes may be named (they need ROS).

    Raises:
        VariantError: an unknown name or host, one given twice, or none at all.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise VariantError("variants: none given; allowed: " + ", ".join(ALL))
    if host not in HOSTS:
        raise VariantError(f"host: {host!r}; allowed: {', '.join(HOSTS)}")
    found: list[Variant] = []
    for name in names:
        variant = _one(name, host, upstream, COLOURS[len(found) % len(COLOURS)])
        if any(variant.id == other.id for other in found):
            raise VariantError(f"variants: {name!r} is given twice")
        found.append(variant)
    several = len({variant.host for variant in found if variant.host}) > 1
    return [_titled(variant, several) for variant in found]


def _one(name: str, default_host: str, upstream: bool, colour: str) -> Variant:
    prefix, separator, rest = name.rpartition(":")
    host = prefix if separator else default_host
    if host == UPSTREAM_HOST and upstream:
        if rest not in UPSTREAMS:
            raise VariantError(f"variants: {name!r}; upstream: allowed: {', '.join(UPSTREAMS)}")
        return Variant(f"upstream_{rest}", UPSTREAMS[rest], "", "", "", rest, colour)
    if host not in HOSTS:
        allowed = (*HOSTS, UPSTREAM_HOST) if upstream else HOSTS
        raise VariantError(f"variants: {name!r}; hosts allowed: {', '.join(allowed)}")
    if rest not in ALL:
        raise VariantError(f"variants: {name!r}; allowed: {', '.join(ALL)}")
    mode = FULL_MODE if rest == FULL else rest
    method = DEFAULT_DEGENERACY if rest == FULL else "none"
    identifier = rest if host == default_host else f"{host}_{rest}"
    return Variant(identifier, rest, host, mode, method, "", colour)


def _titled(variant: Variant, several_hosts: bool) -> Variant:
    if variant.upstream or not several_hosts:
        return variant
    return variant._replace(title=f"{HOST_TITLES[variant.host]} {variant.title}")


def rgb(colour: str) -> list[int]:
    """#rrggbb as three numbers, 0 to 255."""
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]


def find(variants: list[Variant], identifier: str) -> Variant | None:
    """The variant of that id."""
    return next((variant for variant in variants if variant.id == identifier), None)
