"""Similarities are a group, and are found again from their own point pairs, wrong ones among them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aug3d_core.geometry import transforms
from aug3d_core.geometry.similarity import Similarity, fit_similarity, fit_similarity_robustly

SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])


def random_similarity(rng: np.random.Generator, dimensions: int = 3) -> Similarity:
    rotation = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    if dimensions == 2:
        angle = rng.uniform(0, 2 * np.pi)
        rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return Similarity(float(rng.uniform(0.1, 10)), rotation, rng.normal(size=dimensions) * 50)


@given(SEEDS, DIMENSIONS)
def test_inverse_undoes(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    fit, points = random_similarity(rng, dimensions), rng.normal(size=(6, dimensions))
    np.testing.assert_allclose(fit.inverse().apply(fit.apply(points)), points, atol=1e-8)


@given(SEEDS, DIMENSIONS)
def test_after_applies_the_other_first(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = random_similarity(rng, dimensions), random_similarity(rng, dimensions)
    points = rng.normal(size=(6, dimensions))
    np.testing.assert_allclose(second.after(first).apply(points), second.apply(first.apply(points)), atol=1e-7)


@given(SEEDS)
def test_moved_cameras_see_moved_points_as_before(seed: int) -> None:
    rng = np.random.default_rng(seed)
    fit, points = random_similarity(rng), rng.normal(size=(9, 3))
    cam_from_a = np.concatenate(
        [Rotation.random(random_state=seed % 2**31).as_matrix(), rng.normal(size=(3, 1))], axis=1
    )
    before = transforms.apply(cam_from_a, points)
    cam_from_b = fit.move_cameras(cam_from_a)
    np.testing.assert_allclose(transforms.apply(cam_from_b, fit.apply(points)), fit.scale * before, atol=1e-7)
    np.testing.assert_allclose(transforms.centres(cam_from_b), fit.apply(transforms.centres(cam_from_a)), atol=1e-7)


@given(SEEDS, DIMENSIONS)
def test_the_fit_finds_the_truth(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    truth, points = random_similarity(rng, dimensions), rng.normal(size=(8, dimensions))
    fit = fit_similarity(points, truth.apply(points))
    assert fit.scale == pytest.approx(truth.scale)
    np.testing.assert_allclose(fit.rotation, truth.rotation, atol=1e-7)
    np.testing.assert_allclose(fit.translation, truth.translation, atol=1e-6)


def test_the_fit_never_mirrors() -> None:
    points = np.random.default_rng(3).normal(size=(20, 3))
    fit = fit_similarity(points, points * [1, 1, -1])
    assert np.linalg.det(fit.rotation) == pytest.approx(1)


def test_points_in_a_plane_are_enough() -> None:
    rng = np.random.default_rng(4)
    truth, points = random_similarity(rng), rng.normal(size=(8, 3)) * [1, 1, 0]
    np.testing.assert_allclose(fit_similarity(points, truth.apply(points)).rotation, truth.rotation, atol=1e-7)


@settings(max_examples=15, deadline=None)
@given(SEEDS, DIMENSIONS)
def test_wrong_pairs_are_found_out(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    truth, points = random_similarity(rng, dimensions), rng.normal(size=(30, dimensions))
    target = truth.apply(points) + rng.normal(size=(30, dimensions)) * 0.01 * truth.scale
    wrong = rng.choice(30, 10, replace=False)
    target[wrong] += rng.choice([-1, 1], size=(10, dimensions)) * rng.uniform(5, 50, size=(10, 1)) * truth.scale
    fit, used = fit_similarity_robustly(points, target, rng)
    assert not used[wrong].any()
    assert used.sum() >= 15
    assert np.abs(fit.apply(points) - truth.apply(points)).max() < 0.05 * truth.scale


def test_the_robust_fit_repeats() -> None:
    points = np.random.default_rng(5).normal(size=(12, 3))
    target = points + np.random.default_rng(6).normal(size=(12, 3)) * 0.1
    first, _ = fit_similarity_robustly(points, target, np.random.default_rng(0))
    second, _ = fit_similarity_robustly(points, target, np.random.default_rng(0))
    np.testing.assert_array_equal(first.rotation, second.rotation)


def test_three_pairs_are_fitted() -> None:
    rng = np.random.default_rng(7)
    truth, points = random_similarity(rng), rng.normal(size=(3, 3))
    fit, used = fit_similarity_robustly(points, truth.apply(points), rng)
    assert used.all()
    assert fit.scale == pytest.approx(truth.scale)
