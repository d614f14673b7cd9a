"""Why a camera cannot be used: it is inside, under or too near the surface, or its view shows too little of it.

A view is judged on a coarse net of rays. The net asks for a little more than it is to promise, so that what holds on the
net holds on all pixels too. Black is judged by the colours at the mesh's corners; the renderer looks at the texture.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Hits, Raycaster, pixel_rays
from aug3d_core.geometry.transforms import centres, forward

REASONS = ("inside", "under", "too_near", "aim_hidden", "empty", "back_faces", "black", "smeared")
GOOD = -1
NET_PX = 24  # rays across a view
MARGIN = 0.8  # of what a view may lack, asked on the net
IN_SIGHT = 0.5  # nothing may stand in the way in the first half of the way to the aim
UP = np.array([0.0, 0.0, 1.0])


def faults(
    surface: Raycaster,
    cam_from_world: Float[np.ndarray, "n 3 4"],
    radius: Float[np.ndarray, " n"],
    site: Site,
    config: SamplingConfig,
) -> Int[np.ndarray, " n"]:
    """Return what is wrong with each camera, an index of REASONS, or GOOD; `radius` is its distance to its aim."""
    found = _faults_of_place(surface, cam_from_world, radius, config)
    standing = found == GOOD
    if standing.any():
        size = np.maximum(np.rint(site.size * NET_PX / site.size[0]), 1).astype(int)
        shares = lacks(surface, cam_from_world[standing], site, size)
        lacking = 1 - config.min_view_covered
        limits = MARGIN * np.array([lacking, config.max_back_faces, lacking, config.max_smeared])
        found[standing] = _first(shares > limits, REASONS.index("empty"))
    return found


def lacks(
    surface: Raycaster, cam_from_world: Float[np.ndarray, "n 3 4"], site: Site, size: Int[np.ndarray, " 2"]
) -> Float[np.ndarray, "n 4"]:
    """Return which share of each view is empty, shows the surface from behind, is black, and is smeared; at this size.

    Smeared is what the view of full size shows more finely than the photos about justify.
    """
    scale = size[0] / site.size[0]
    answer = np.empty((len(cam_from_world), 4))
    for row, camera in zip(answer, cam_from_world, strict=True):
        origin, directions = pixel_rays(camera, site.intrinsics * scale, size)
        hits = surface.cast(origin, directions)
        hit = hits.triangle >= 0
        black = site.black[hits.triangle] & hit
        smeared = (hits.distance / site.focal_px < site.justified[hits.triangle]) & hit
        row[:] = 1 - hit.mean(), (from_behind(hits, directions) & hit).mean(), black.mean(), smeared.mean()
    return answer


def from_behind(hits: Hits, directions: Float[np.ndarray, "*r 3"]) -> Bool[np.ndarray, " *r"]:
    """Tell which rays leave the surface through its outside, which the triangles' winding tells."""
    return np.einsum("...k,...k->...", hits.normal, directions) > 0


def _faults_of_place(
    surface: Raycaster,
    cam_from_world: Float[np.ndarray, "n 3 4"],
    radius: Float[np.ndarray, " n"],
    config: SamplingConfig,
) -> Int[np.ndarray, " n"]:
    places = centres(cam_from_world)
    above = surface.cast(places, UP)
    roofed, behind = above.triangle >= 0, from_behind(above, np.broadcast_to(UP, places.shape))
    too_near = surface.distance(places) < config.min_clearance * radius
    hidden = surface.cast(places, forward(cam_from_world)).distance < IN_SIGHT * radius
    return _first(np.stack([roofed & behind, roofed, too_near, hidden], axis=1), REASONS.index("inside"))


def _first(wrong: Bool[np.ndarray, "n r"], start: int) -> Int[np.ndarray, " n"]:
    """Return the first reason of each row, counted from `start`, or GOOD."""
    return np.where(wrong.any(axis=1), start + wrong.argmax(axis=1), GOOD)
