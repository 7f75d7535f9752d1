# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""From ray hits to reported points: detection, range noise, intensity."""

from __future__ import annotations

import numpy as np

from d2lio.simulator.lidar import Sensor
from d2lio.simulator.mesh import KEEP, REFLECTIVITY
from d2lio.simulator.world import Hits

RANDOM_LOSS = 0.002  # share of good rays that any sensor loses
GRAZING_COSINE = 0.05  # about 87 deg: below it, the smeared echo is lost


def detection_probability(
    distance: np.ndarray, cosine: np.ndarray, material: np.ndarray, range_10: float
) -> np.ndarray:
    """Chance (n,) that an echo is reported.

    The echo of a Lambertian surface falls with ρ cos θ / r²; a 10 % target straight ahead at
    range_10 is seen half of the time. Grazing rays smear over the surface and fade earlier.
    """
    strength = 10.0 * REFLECTIVITY[material] * cosine * (range_10 / distance) ** 2
    power = strength**3 / (1.0 + strength**3)
    grazing = -np.expm1(-((cosine / GRAZING_COSINE) ** 2))
    return (1.0 - RANDOM_LOSS) * KEEP[material] * power * grazing


def intensity(hits_cosine: np.ndarray, material: np.ndarray) -> np.ndarray:
    """Calibrated intensity (n,) in [0, 255]: reflectivity times incidence."""
    return np.clip(255.0 * REFLECTIVITY[material] * hits_cosine, 0.0, 255.0)


def measure(
    hits: Hits, sensor: Sensor, range_noise: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices (m,) of the rays that return, their ranges (m,) m and intensities (m,).

    Draws the same number of random values whatever is hit, so that scenes do not shift the noise.
    """
    count = len(hits.distance)
    luck = rng.random(count)
    noise = rng.standard_normal(count)
    shade = rng.standard_normal(count)
    index = np.flatnonzero(np.isfinite(hits.distance) & (hits.distance < sensor.max_range))
    distance, cosine, material = hits.distance[index], hits.cosine[index], hits.material[index]
    kept = luck[index] < detection_probability(distance, cosine, material, sensor.range_10)
    index, distance, cosine, material = index[kept], distance[kept], cosine[kept], material[kept]
    distance = distance + range_noise * noise[index]
    if range_noise > 0.0:
        distance = np.round(distance / sensor.resolution) * sensor.resolution
    value = np.clip(intensity(cosine, material) * (1.0 + 0.05 * shade[index]), 0.0, 255.0)
    valid = (distance >= sensor.min_range) & (distance <= sensor.max_range)
    return index[valid], distance[valid], value[valid]
