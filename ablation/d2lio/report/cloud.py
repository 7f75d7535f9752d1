# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A thin point cloud of a sequence's surroundings, to draw paths in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.ablate.suite import Simulate, SuiteSequence, slug
from d2lio.datasets import ImuBlock, Source, timed_events
from d2lio.datasets.events import Scan
from d2lio.metrics.matching import max_gap_s
from d2lio.metrics.tum import Trajectory, interpolate, read_tum

MAPS_DIR = "maps"
POINTS = 8000
STATIONS = 60  # places along the path that look around
REACH_M = 60.0
SEED = 0


def map_file(out: Path, sequence: str) -> Path:
    """Where a saved cloud of a sequence lies: float32 [N, 3], m, in the truth's frame."""
    return out / MAPS_DIR / f"{slug(sequence)}.npy"


def load_map(out: Path, sequence: SuiteSequence, repeat: int, truth: np.ndarray) -> np.ndarray:
    """The cloud saved for a sequence, or what can be seen of a simulated scene from the truth.

    Args:
        out: directory of the ablation.
        repeat: chooses the seed of a simulated scene.
        truth: positions of the path, float64 [M, 3], m.

    Returns:
        float32 [N, 3], m; empty where neither can be had.
    """
    file = map_file(out, sequence.name)
    if file.exists():
        return np.load(file, allow_pickle=False)[:POINTS]
    if sequence.simulate is None or len(truth) == 0:
        return np.empty((0, 3), np.float32)
    return scene_map(sequence.simulate, repeat, truth)


def scene_map(what: Simulate, repeat: int, truth: np.ndarray) -> np.ndarray:
    """Points of a simulated scene that rays from the path hit, float32 [N, 3], m."""
    from d2lio.simulator.pipeline import Seeds, build_world

    seed = what.seed_base + repeat
    world = build_world(what.scene, Seeds(seed, seed, seed), what.duration)
    rng = np.random.default_rng(SEED)
    places = truth[np.linspace(0, len(truth) - 1, STATIONS).astype(int)]
    origin = np.repeat(places, 2 * POINTS // STATIONS, axis=0)
    direction = rng.standard_normal(origin.shape)
    direction[:, 2] *= 0.4  # most of what a lidar sees lies beside it
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    distance = world.fixed.cast(origin, direction).distance
    seen = np.flatnonzero(distance < REACH_M)
    points = origin[seen] + distance[seen, None] * direction[seen]
    return _thin(points, rng)


def save_map(source: Source, truth_file: Path, file: Path, scans: int = STATIONS) -> int:
    """Saves a cloud made of a recording's scans, each point at the truth's pose of its instant.

    Args:
        source: opened data set.
        truth_file: TUM, T_world_imu with attitudes.
        file: see `map_file`.
        scans: about so many of them are used.

    Returns:
        The number of points; nothing is written for 0 (no attitudes, no overlap in time).

    Raises:
        DataError: unreadable input.
    """
    truth = read_tum(truth_file)
    if truth.position_only:
        return 0
    step = max(1, (source.reader.scan_total or 0) // scans)
    rng = np.random.default_rng(SEED)
    parts, number = [], 0
    for event in timed_events(source.reader, log_times=source.log_times):
        if isinstance(event, ImuBlock):
            continue
        if number % step == 0:
            parts.append(_placed(event, truth, source.config.extrinsic, rng))
        number += 1
    points = _thin(np.concatenate(parts) if parts else np.empty((0, 3)), rng)
    if len(points):
        file.parent.mkdir(parents=True, exist_ok=True)
        np.save(file, points)
    return len(points)


def _placed(
    scan: Scan, truth: Trajectory, T_imu_lidar: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Some points of a scan in the truth's frame, float64 [N, 3]."""
    distance = np.linalg.norm(scan.xyz, axis=1)
    usable = np.flatnonzero(np.isfinite(distance) & (distance > 0.5) & (distance < REACH_M))
    chosen = rng.permutation(usable)[: 2 * POINTS // STATIONS]
    stamps, index = np.unique(scan.stamp + scan.dt_ns[chosen].astype(np.int64), return_inverse=True)
    poses = interpolate(truth, stamps, max_gap_s(truth))
    known = np.isin(stamps[index], poses.stamps)
    row = np.searchsorted(poses.stamps, stamps[index][known])
    points = scan.xyz[chosen][known] @ T_imu_lidar[:3, :3].T + T_imu_lidar[:3, 3]
    if not len(points):
        return np.empty((0, 3))
    return Rotation.from_quat(poses.quaternions[row]).apply(points) + poses.positions[row]


def _thin(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.permutation(points)[:POINTS].astype(np.float32)
