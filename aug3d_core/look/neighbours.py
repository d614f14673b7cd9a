"""What two photographs that were taken one after the other have in common: no positions are needed for it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float, UInt8

_FEATURES = 400
_LEAST_MATCHES = 12  # that one plane explains; fewer are chance
_BETTER = 0.8  # a match is this much nearer than the next (Lowe 2004)
_APART_PX = 4.0  # of the plane's prediction: roofs and hills are no plane


@dataclass(frozen=True)
class Sketch:
    """What is kept of a small copy of a picture to find it in another. small_px: width and height. places_px: of features."""

    small_px: tuple[int, int]
    places_px: Float[np.ndarray, "k 2"]
    features: UInt8[np.ndarray, "k 128"]


def sketch_of(grey: UInt8[np.ndarray, "h w"]) -> Sketch:
    """Find the features of a small grey picture."""
    keypoints, features = cv2.SIFT.create(_FEATURES).detectAndCompute(grey, np.full_like(grey, 255))
    features = np.zeros((0, 128)) if features is None else features
    places_px = np.array([point.pt for point in keypoints], float).reshape(-1, 2)
    return Sketch((grey.shape[1], grey.shape[0]), places_px, features.clip(0, 255).astype(np.uint8))


@dataclass(frozen=True)
class Step:
    """From one photograph to the next. overlap: share of the first that the second shows too; 0 if nothing is found.

    moved: where the middle of the first lies in the second, minus the middle, as a share of the width, x right and y down.
    turned_rad: by how much the picture turned, clockwise. scale: of the second, in the first's size.
    """

    overlap: float
    moved: tuple[float, float]
    turned_rad: float
    scale: float

    @property
    def length(self) -> float:
        """How far the picture moved, as a share of its width."""
        return float(np.hypot(*self.moved))


NOTHING = Step(0.0, (np.nan, np.nan), np.nan, np.nan)


def steps_between(photos: Sequence[Sketch]) -> list[Step]:
    """Compare each photograph with the next one."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return list(pool.map(lambda pair: step(*pair), pairwise(photos)))


def step(first: Sketch, second: Sketch) -> Step:
    """Find the first picture in the second; NOTHING where too little of it is there."""
    if min(len(first.features), len(second.features)) < _LEAST_MATCHES:
        return NOTHING
    near = cv2.BFMatcher(cv2.NORM_L2).knnMatch(first.features, second.features, k=2)
    good = [best for best, next_best in near if best.distance < _BETTER * next_best.distance]
    if len(good) < _LEAST_MATCHES:
        return NOTHING
    here = first.places_px[[match.queryIdx for match in good]]
    there = second.places_px[[match.trainIdx for match in good]]
    second_from_first, inside = cv2.findHomography(here, there, cv2.RANSAC, _APART_PX)
    if second_from_first is None or int(inside.sum()) < _LEAST_MATCHES:
        return NOTHING
    return _step_by(second_from_first, first.small_px, second.small_px)


def _step_by(
    second_from_first: Float[np.ndarray, "3 3"], first_px: tuple[int, int], second_px: tuple[int, int]
) -> Step:
    """Describe a step by the plane that most matches lie on; one that turns the picture inside out is no step."""
    (width, height), (width_2, height_2) = first_px, second_px
    middle, right = np.array([width / 2, height / 2]), np.array([width / 2 + width / 8, height / 2])
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    weights = second_from_first[2] @ np.vstack([np.vstack([corners, middle, right]).T, np.ones(6)])
    if (weights <= 1e-9).any() or np.linalg.det(second_from_first[:2, :2]) <= 0:
        return NOTHING
    placed = cv2.perspectiveTransform(np.vstack([corners, middle, right])[None], second_from_first)[0]
    frame = np.array([[0, 0], [width_2, 0], [width_2, height_2], [0, height_2]], np.float32)
    common, _ = cv2.intersectConvexConvex(placed[:4].astype(np.float32), frame)
    area = abs(cv2.contourArea(placed[:4].astype(np.float32)))
    if area < 1.0:
        return NOTHING
    middle_moved = (placed[4] - [width_2 / 2, height_2 / 2]) / width_2
    along = placed[5] - placed[4]
    return Step(
        overlap=float(min(common / area, 1.0)),
        moved=(float(middle_moved[0]), float(middle_moved[1])),
        turned_rad=float(np.arctan2(along[1], along[0])),
        scale=float(np.hypot(*along) / (width / 8)),
    )
