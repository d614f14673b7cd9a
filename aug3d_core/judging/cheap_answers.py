"""The cheap answers that a model must beat, each at its strongest. All see the same inputs as the model.

Inputs are ranked by how far the ground moves in the image between them and the target: the first is the one whose copy
is the best guess, and whose view of the ground is the least distorted.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.dataset.projection import ground_points, project
from aug3d_core.dataset.rays import pixel_centres
from aug3d_core.dataset.scene import FINER, LEAST_SHOWN, Scene
from aug3d_core.judging.warped_answers import guided_blend, plane_sweep


def cheap_answers(scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> dict[str, UInt8[np.ndarray, "h w 3"]]:
    """Return the target as each cheap answer has it, by the answer's name."""
    ranked = rank(scene, target, inputs)
    mean = _mean_colour(scene, inputs)
    return {
        "mean_colour": _round(np.broadcast_to(mean, scene.images[target].shape)),
        "nearest_copy": scene.images[ranked[0]],
        "ground_homography": ground_homography(scene, target, inputs),
        "plane_sweep": plane_sweep(scene, target, inputs),
        "mesh_render": _mesh(scene, target, mean),
        "guided_blend": guided_blend(scene, target, inputs),
    }


def rank(scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> Int[np.ndarray, " v"]:
    """Order inputs by the median image distance between a ground point in the target and in them."""
    here = pixel_centres(scene.width_px, scene.height_px)
    ground, reached = ground_points(scene, target)
    moved = []
    for view in inputs:
        there, ahead = project(scene, view, ground)
        use = reached & ahead
        moved.append(np.median(np.linalg.norm(there[use] - here[use], axis=1)) if use.any() else np.inf)
    return inputs[np.argsort(moved, kind="stable")]


def ground_homography(scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return the inputs' colours as they lie on the ground, the nearest's on top; their mean where none reaches."""
    ground, reached = ground_points(scene, target)
    answer = np.tile(_mean_colour(scene, inputs), (len(ground), 1))
    for view in rank(scene, target, inputs)[::-1]:
        xy_px, ahead = project(scene, view, ground)
        inside = ((xy_px >= 0) & (xy_px <= [scene.width_px, scene.height_px])).all(axis=1) & reached & ahead
        inside[inside] = bilinear(scene.alpha[view][..., None], xy_px[inside])[:, 0] >= LEAST_SHOWN
        answer[inside] = _mean_of_parts(scene.fine(np.array([view]))[0], xy_px[inside])
    return _round(answer.reshape(scene.images[target].shape))


def _mean_colour(scene: Scene, inputs: Int[np.ndarray, " v"]) -> Float[np.ndarray, " 3"]:
    """Return the mean of what inputs show."""
    colours, shown = scene.images[inputs], scene.alpha[inputs] >= LEAST_SHOWN
    return (colours.reshape(-1, 3) if shown.all() else colours[shown]).mean(axis=0)


def _mesh(scene: Scene, target: int, mean: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    row = int(np.flatnonzero(scene.baseline_view == target)[0])
    cover = scene.baseline_alpha[row][..., None] / 255
    return _round(scene.baseline_images[row] * cover + mean * (1 - cover))


def bilinear(image: UInt8[np.ndarray, "h w c"], xy_px: Float[np.ndarray, "p 2"]) -> Float[np.ndarray, "p c"]:
    """Interpolate an image at positions whose pixel centres are at half-integers; the border is repeated."""
    height, width = image.shape[:2]
    x, y = np.clip(xy_px[:, 0] - 0.5, 0, width - 1), np.clip(xy_px[:, 1] - 0.5, 0, height - 1)
    left, top = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    u, v = (x - left)[:, None], (y - top)[:, None]
    upper = image[top, left] * (1 - u) + image[top, right] * u
    return upper * (1 - v) + (image[bottom, left] * (1 - u) + image[bottom, right] * u) * v


def _mean_of_parts(fine: UInt8[np.ndarray, "h w c"], xy_px: Float[np.ndarray, "p 2"]) -> Float[np.ndarray, "p c"]:
    """Return what a fine image shows in the squares of a pixel about positions that are given in pixels."""
    parts = (np.arange(FINER) + 0.5) / FINER - 0.5
    return np.mean([bilinear(fine, FINER * (xy_px + np.array([x, y]))) for x in parts for y in parts], axis=0)


def _round(values: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)
