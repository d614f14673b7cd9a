"""Where to search: the planes for one photograph, within a slab that a quick look at a quarter of the size found.

Sparse points miss what has no corners that match, tree crowns above all. The quick look is cheap (a quarter of the planes on a
sixteenth of the pixels) and so can search far higher and lower than they reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from aug3d_core.depth.cameras import Camera
from aug3d_core.depth.job import PhotoTask
from aug3d_core.depth.planes import Family, horizontal_normal, make_family
from aug3d_core.depth.sweep import Photo, sweep

_QUARTER = 4
_CERTAIN = 0.7  # score of a pixel that counts in the quick look
_OUTLIERS_PCT = 1.0
_ABOVE, _BELOW = 0.4, 0.1  # of the camera's height over the middle of the slab: how far the quick look goes beyond it
_MARGIN = 2.0  # pixels of the quick look: what one is uncertain by
_OBLIQUE_DEG = 20.0  # below this, planes that face the camera are as good as horizontal ones


class Range(NamedTuple):
    """A family of planes before it is known how many it takes: normal in the camera's frame, distances."""

    normal: np.ndarray
    nearest: float
    farthest: float


def ranges_for(reference: Photo, sources: list[Photo], task: PhotoTask, step_px: float) -> list[Range]:
    """Return the range of horizontal planes, and for a photograph that looks aside also of planes that face it.

    A camera that is no higher than what it sees looks down on nothing: for it only planes that face it are left.
    """
    camera = reference.camera
    down = horizontal_normal(camera)
    lowest, highest = _slab(reference, sources, task, step_px)
    height = _height(camera)
    ranges = [Range(down, height - highest, height - lowest)] if lowest < highest else []
    if not ranges or np.degrees(np.arccos(np.clip(down[2], -1, 1))) > _OBLIQUE_DEG:
        ranges.append(Range(np.array([0.0, 0.0, 1.0]), *task.depth))
    return ranges


def families_for(reference: Camera, sources: list[Camera], ranges: list[Range], step_px: float) -> list[Family]:
    """Return the planes of each range, as many as cameras of this size can tell apart."""
    return [make_family(reference, sources, *each, step_px) for each in ranges]


def _slab(reference: Photo, sources: list[Photo], task: PhotoTask, step_px: float) -> tuple[float, float]:
    """Return lowest and highest height: the sparse points' range, and what a sweep at a quarter of the size adds to it."""
    lowest, highest = task.height
    height = _height(reference.camera)
    above = height - 0.5 * (lowest + highest)
    ceiling, floor = min(highest + _ABOVE * above, height - 0.3 * above), lowest - _BELOW * above
    if ceiling <= highest or highest <= lowest:
        return lowest, highest
    small, others = reduced(reference, _QUARTER), [reduced(source, _QUARTER) for source in sources]
    cameras = [other.camera for other in others]
    down = horizontal_normal(small.camera)
    planes = make_family(small.camera, cameras, down, height - ceiling, height - floor, step_px)
    margin = _MARGIN * above / float(small.camera.intrinsics[0])
    found = sweep(small, others, [planes])
    alike = np.abs(cv2.medianBlur(found.depth, 5) - found.depth) < margin  # chance finds stand alone
    certain = alike & (found.score > _CERTAIN) & (small.grey > 0)
    if not certain.any():
        return lowest, highest
    points = small.camera.rays[certain] * found.depth[certain, None]
    heights = height - points @ down
    low, high = np.percentile(heights, [_OUTLIERS_PCT, 100 - _OUTLIERS_PCT])
    return min(lowest, float(low) - margin), max(highest, float(high) + margin)


def reduced(photo: Photo, by: int) -> Photo:
    """Return a photograph made smaller by averaging."""
    camera = photo.camera
    width, height = max(1, camera.width // by), max(1, camera.height // by)
    scale = np.tile([width / camera.width, height / camera.height], 2)
    grey = cv2.resize(photo.grey, (width, height), interpolation=cv2.INTER_AREA)
    if not photo.grey.all():  # what is masked is black: no mean is of it
        whole = cv2.resize(
            np.where(photo.grey > 0, np.uint8(255), np.uint8(0)), (width, height), None, 0, 0, cv2.INTER_AREA
        )
        grey[whole < 255] = 0
    return Photo(grey, replace(camera, intrinsics=camera.intrinsics * scale, width=width, height=height))


def _height(camera: Camera) -> float:
    return float(-camera.cam_from_world[:, 3] @ camera.cam_from_world[:, 2])
