# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The scenes, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from d2lio.simulator.scenes import corridor, highway, outdoors, room, street, tunnel
from d2lio.simulator.world import World

Build = Callable[[np.random.Generator, np.random.Generator, float], World]


@dataclass(frozen=True)
class Scene:
    """A scene: default duration in s, and build(scene rng, motion rng, duration) -> World."""

    description: str
    duration: float
    build: Build


SCENES: dict[str, Scene] = {
    "tunnel": Scene("bare straight road tunnel, 60 m driven", 47.0, tunnel.bare),
    "tunnel_cabinets": Scene("the same with a few cabinets", 47.0, tunnel.cabinets),
    "corridor": Scene("long corridor with few doors", 40.0, corridor.build),
    "offroad": Scene("height field with trees and bushes", 40.0, outdoors.offroad),
    "waterway": Scene("canal: absorbing water, overgrown banks", 40.0, outdoors.waterway),
    "flat_ground": Scene("open flat ground, hardly anything else", 30.0, outdoors.flat_ground),
    "dense_street": Scene("facades, parked and moving cars, poles", 40.0, street.build),
    "highway": Scene("guard rails, poles, few structures, 23 m/s", 40.0, highway.highway),
    "bridge": Scene("suspension bridge over water, 10 m/s", 40.0, highway.bridge),
    "room": Scene("furnished room, handheld", 25.0, room.build),
}
