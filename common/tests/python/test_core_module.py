# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nanobind module `d2lio._core`: numpy in, numpy out, errors that name key and value."""

from __future__ import annotations

import threading
from importlib import resources

import numpy as np
import pytest
from d2lio import _core
from d2lio.errors import ConfigError


def test_the_tree_finds_what_brute_force_finds():
    rng = np.random.default_rng(0)
    points = rng.uniform(-20, 20, (5000, 3)).astype(np.float32)
    tree = _core.IkdTree(downsample_leaf=0.5)
    assert tree.build(points) == 5000
    queries = rng.uniform(-20, 20, (50, 3)).astype(np.float32)
    found, sq = tree.knn(queries, 5)
    distances = np.linalg.norm(points[None].astype(float) - queries[:, None].astype(float), axis=2)
    expected = np.sort(distances**2, axis=1)[:, :5]
    assert found.shape == (50, 5, 3)
    assert found.dtype == np.float32
    np.testing.assert_allclose(sq, expected, rtol=1e-4, atol=1e-5)


def test_tree_insertion_and_box_deletion():
    tree = _core.IkdTree(downsample_leaf=1.0)
    points = np.array([[0.1, 0.1, 0.1], [0.5, 0.5, 0.5], [5.5, 0.5, 0.5]], np.float32)
    report = tree.insert(points)
    assert len(tree) == 2
    assert report["added"] - report["removed"] == 2
    removed = tree.erase_box(np.array([5, 0, 0], np.float32), np.array([6, 1, 1], np.float32))
    assert removed == 1
    np.testing.assert_array_equal(tree.points(), points[1:2])


def test_missing_neighbours_are_nan_and_infinity():
    tree = _core.IkdTree()
    found, sq = tree.knn(np.zeros((1, 3), np.float32), 3)
    assert np.isnan(found).all()
    assert np.isinf(sq).all()


def test_voxel_grid_gives_one_centroid_per_voxel():
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.9, 0.1, 0.1]], np.float32)
    np.testing.assert_allclose(
        _core.voxel_grid(points, 0.5), [[0.2, 0.1, 0.1], [0.9, 0.1, 0.1]], atol=1e-6
    )


def test_refused_options_name_key_value_and_range():
    with pytest.raises(ConfigError) as caught:
        _core.Rejector({"rejection.tau": "-3"})
    assert caught.value.key == "rejection.tau"
    assert caught.value.value == "-3"
    assert "[0, " in caught.value.allowed
    with pytest.raises(ConfigError, match="downsample_leaf"):
        _core.IkdTree(downsample_leaf=-1.0)
    with pytest.raises(ConfigError, match=r"rejection\.tow"):
        _core.Rejector({"rejection.tow": "1"})


def test_wrong_arrays_are_refused():
    tree = _core.IkdTree()
    with pytest.raises(TypeError):
        tree.build(np.zeros((4, 2), np.float32))


def test_point_adaptive_thresholds_follow_the_paper():
    rejector = _core.Rejector({"rejection.mode": "point_adaptive", "rejection.epsilon_0": "0"})
    motion = np.eye(4)
    motion[:3, :3] = [[np.cos(0.2), -np.sin(0.2), 0], [np.sin(0.2), np.cos(0.2), 0], [0, 0, 1]]
    motion[0, 3] = 0.7
    rejector.begin_scan(motion)
    ranges = np.array([0.0, 3.0, 50.0])
    np.testing.assert_allclose(rejector.threshold(ranges), 0.7 + 2 * ranges * np.sin(0.1))


def test_analysis_matches_numpy():
    rng = np.random.default_rng(3)
    A_r, A_t = rng.normal(size=(300, 3)), rng.normal(size=(300, 3)) * [0.05, 1.0, 1.0]
    out = _core.analyse(A_r, A_t)
    np.testing.assert_allclose(out["lambda_t"], np.linalg.eigvalsh(A_t.T @ A_t), rtol=1e-9)
    np.testing.assert_allclose(out["lambda_r"], np.linalg.eigvalsh(A_r.T @ A_r), rtol=1e-9)
    assert abs(out["v_t"][0, 0]) > 0.99


def test_prior_is_strong_only_where_the_scan_is_blind():
    information = np.diag([10.0, 400.0, 450.0])
    P = 0.01 * np.eye(3)
    out = _core.prior({"degeneracy.method": "paper"}, information, information, P, P)
    np.testing.assert_allclose(np.diag(out["W_t"]), 30.0 / 0.01 / np.diag(information), rtol=1e-9)
    remap = _core.prior({"degeneracy.method": "remap"}, information, information, P, P)
    np.testing.assert_allclose(remap["keep_t"], np.diag([0.0, 1.0, 1.0]), atol=1e-12)


def test_the_interpreter_runs_on_while_the_tree_builds():
    points = np.random.default_rng(0).uniform(-50, 50, (1_000_000, 3)).astype(np.float32)
    tree = _core.IkdTree()
    worker = threading.Thread(target=tree.build, args=(points,))
    worker.start()
    ticks = 0
    while worker.is_alive():
        ticks += 1
    worker.join()
    assert len(tree) == len(points)
    assert ticks > 1000  # with the lock held there would be a handful at most


def test_typed_stubs_are_installed():
    files = {f.name for f in resources.files("d2lio").iterdir()}
    assert {"_core.pyi", "_fastlio.pyi", "py.typed"} <= files
