"""How far a point moves from one view of a group to another while it rises through the scene."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.factory.auto.decision import Known
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.sfm.files import POINTS, VIEWS

_LOWEST = 0.02  # share of the points below the ground: strays


def parallax_px(
    views: Views,
    members: Int[np.ndarray, "c k"],
    points_in_world: Float[np.ndarray, "p 3"],
    thickness: float,
    width_px: int,
) -> float:
    """Return the parallax (px of views so wide) across a layer of a thickness on the ground, between views of a group.

    f B (1 / (h - t) - 1 / h): B is the median distance of a group's members from its first, h the median height of the
    cameras over the ground, z up.
    """
    at = centres(views.cam_from_world)
    baseline = float(np.median(np.linalg.norm(at[members[:, 1:]] - at[members[:, :1]], axis=-1)))
    height = float(np.median(at[:, 2]) - np.quantile(points_in_world[:, 2], _LOWEST))
    focal_px = float(np.median(views.intrinsics[:, 0] / views.size[:, 0])) * width_px
    nearest = max(height - thickness, 0.1 * height)  # a camera within the layer: nearer than this is not looked at
    return focal_px * baseline * (1 / nearest - 1 / height)


def known_parallax(known: Known) -> float | None:
    """Return the parallax (px of a packed view) in a scene whose layer between ground and roofs is known, None of others."""
    thickness, sfm, groups = (
        known.figure("dataset", "slab_thickness"),
        known.folder("sfm", VIEWS, POINTS),
        known.folder("grouping", GROUPS),
    )
    if thickness is None or sfm is None or groups is None:
        return None
    with np.load(groups / GROUPS, allow_pickle=False) as arrays:
        members = arrays["members"]
    views, points = Views.load(sfm / VIEWS), Points.load(sfm / POINTS)
    return parallax_px(views, members, points.xyz, thickness, known.config.dataset.width_px)
