"""Which cameras can be used: free of the surface, not under it, with their aim in sight and the view well filled."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sampling.site import Site
from aug3d_core.surface.raycast import Raycaster, pixel_rays

PROBE_PX = 12  # rays across a view to judge how much of it shows surface
IN_SIGHT = 0.5  # nothing may stand in the way in the first half of the way to the aim


def usable(
    surface: Raycaster,
    cam_from_world: Float[np.ndarray, "n 3 4"],
    radius: Float[np.ndarray, " n"],
    site: Site,
    config: SamplingConfig,
) -> Bool[np.ndarray, " n"]:
    """Tell which cameras can be used; `radius` is the distance of each to its aim."""
    places = centres(cam_from_world)
    clear = surface.distance(places) >= config.min_clearance * radius
    above = np.isinf(surface.cast(places, np.array([0.0, 0.0, 1.0])).distance)
    in_sight = surface.cast(places, forward(cam_from_world)).distance >= IN_SIGHT * radius
    return clear & above & in_sight & (covered_share(surface, cam_from_world, site) >= config.min_view_covered)


def covered_share(
    surface: Raycaster, cam_from_world: Float[np.ndarray, "n 3 4"], site: Site
) -> Float[np.ndarray, " n"]:
    """Return the share of each view that shows surface, from a coarse net of rays."""
    scale = PROBE_PX / site.size[0]
    size = np.maximum(np.rint(site.size * scale), 1).astype(int)
    rays = [pixel_rays(camera, site.intrinsics * scale, size) for camera in cam_from_world]
    origins = np.stack([origin for origin, _ in rays])[:, None, None]
    hits = surface.cast(origins, np.stack([direction for _, direction in rays]))
    return (hits.triangle >= 0).mean(axis=(1, 2))
