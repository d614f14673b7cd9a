"""Similarity transforms x -> scale * rotation @ x + translation, fitted to pairs of points in 2 or 3 dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.geometry.robust import spread

_TRIALS = 1000


@dataclass(frozen=True)
class Similarity:
    """Map frame a to frame b: `x_in_b = scale * rotation @ x_in_a + translation`."""

    scale: float
    rotation: Float[np.ndarray, "d d"]
    translation: Float[np.ndarray, " d"]

    def apply(self, points_in_a: Float[np.ndarray, "*n d"]) -> Float[np.ndarray, "*n d"]:
        """Map points from frame a to frame b."""
        return self.scale * points_in_a @ self.rotation.T + self.translation

    def after(self, other: Similarity) -> Similarity:
        """Return the map that applies `other` first, then this one."""
        return Similarity(self.scale * other.scale, self.rotation @ other.rotation, self.apply(other.translation))

    def inverse(self) -> Similarity:
        """Return the map from frame b to frame a."""
        return Similarity(1 / self.scale, self.rotation.T, -self.rotation.T @ self.translation / self.scale)

    def move_cameras(self, cam_from_a: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
        """Return `cam_from_b`, with the cameras' own frames scaled along, so that they stay rigid."""
        rotation = cam_from_a[..., :3] @ self.rotation.T
        translation = self.scale * cam_from_a[..., 3] - rotation @ self.translation
        return np.concatenate([rotation, translation[..., None]], axis=-1)


def fit_similarity(points_in_a: Float[np.ndarray, "n d"], points_in_b: Float[np.ndarray, "n d"]) -> Similarity:
    """Fit the least-squares similarity b_from_a (Umeyama 1991); the points must not coincide."""
    mean_a, mean_b = points_in_a.mean(axis=0), points_in_b.mean(axis=0)
    from_a, from_b = points_in_a - mean_a, points_in_b - mean_b
    u, singular, vt = np.linalg.svd(from_b.T @ from_a)
    signs = np.ones(len(singular))
    signs[-1] = np.sign(np.linalg.det(u @ vt)) or 1.0  # no mirror images
    rotation = (u * signs) @ vt
    scale = float((singular * signs).sum() / np.square(from_a).sum())
    return Similarity(scale, rotation, mean_b - scale * rotation @ mean_a)


def fit_similarity_robustly(
    points_in_a: Float[np.ndarray, "n d"], points_in_b: Float[np.ndarray, "n d"], rng: np.random.Generator
) -> tuple[Similarity, Bool[np.ndarray, " n"]]:
    """Fit b_from_a where up to nearly half of the pairs may be wrong; return the fit and which pairs it rests on.

    Least median of squares over random minimal sets, then least squares over the pairs within 3 robust deviations.
    """
    best, best_median = fit_similarity(points_in_a, points_in_b), np.inf
    for sample in _samples(len(points_in_a), points_in_a.shape[1], rng):
        if np.ptp(points_in_a[sample], axis=0).max() == 0:
            continue
        fit = fit_similarity(points_in_a[sample], points_in_b[sample])
        median = np.median(_residuals(fit, points_in_a, points_in_b))
        if median < best_median:
            best, best_median = fit, median
    inliers = np.ones(len(points_in_a), bool)
    for _ in range(3):
        residuals = _residuals(best, points_in_a, points_in_b)
        tolerance = 3 * spread(residuals)
        inliers = residuals <= max(tolerance, np.sort(residuals)[min(len(residuals), points_in_a.shape[1]) - 1])
        best = fit_similarity(points_in_a[inliers], points_in_b[inliers])
    return best, inliers


def _samples(count: int, size: int, rng: np.random.Generator) -> Int[np.ndarray, "trials size"]:
    return np.argsort(rng.random((_TRIALS, count)), axis=1)[:, : min(size, count)]


def _residuals(
    fit: Similarity, points_in_a: Float[np.ndarray, "n d"], points_in_b: Float[np.ndarray, "n d"]
) -> Float[np.ndarray, " n"]:
    return np.linalg.norm(fit.apply(points_in_a) - points_in_b, axis=1)
