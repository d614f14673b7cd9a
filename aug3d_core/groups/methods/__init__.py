"""The ways of grouping, by the name that the configuration gives them; `scene.py` says what they share.

sequence       runs of K in the order of capture
grid           cells of the ground under the cameras, with and without a constraint on where they look
ray            where central rays meet the ground
shared_points  the views that share most points with a centre
surface        the views that see most of the same surface
similar        what the last two have in common
"""

from __future__ import annotations

from aug3d_core.groups.methods import grid, ray, sequence, shared_points, surface
from aug3d_core.groups.scene import Excluded, Group

METHODS: dict[str, Group] = {
    "sequence": sequence.group,
    "grid": grid.group,
    "grid_any_angle": grid.group_any_angle,
    "ray": ray.group,
    "shared": shared_points.group,
    "surface": surface.group,
}
EXCLUDED: dict[str, Excluded] = {
    "ray": ray.excluded,
    "shared": shared_points.excluded,
    "surface": surface.excluded,
}
