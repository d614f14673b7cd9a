"""Photographs taken in one pose, as by a drone that hovers: a second one adds nothing to a group."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Views

_BASELINE = 0.01  # of the distance to what is seen: below it two views see the same to the pixel, near enough
_ANGLE_DEG = 3.0


def twins(views: Views, looked_at: Float[np.ndarray, "n 3"]) -> list[list[int]]:
    """Return for each view those whose centre and direction are the same; `looked_at` says how far away the scene is.

    The same means within 1 % of the median distance to the scene, and 3 degrees.
    """
    at = centres(views.cam_from_world)
    distance = max(float(np.median(np.linalg.norm(looked_at - at, axis=1))), 1e-12)
    chord = 2 * np.sin(np.radians(_ANGLE_DEG) / 2)
    pose = np.hstack([at / (_BASELINE * distance), forward(views.cam_from_world) / chord])
    near = KDTree(pose).query_ball_point(pose, 1.0, return_sorted=True)
    return [[other for other in others if other != view] for view, others in enumerate(near)]
