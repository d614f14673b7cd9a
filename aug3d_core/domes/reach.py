"""How much of the surface, from how many directions, photographs and domes show.

The measure is the same for every way of sampling: of all sights that the sky allows (see `sight`), the share that is
seen; a sight counts as many pixels as it takes. What the photographs do not show that finely themselves is not asked
for: it would be smeared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations

import numpy as np
from jaxtyping import Bool, Float

from aug3d_core.domes.cameras import Cameras
from aug3d_core.domes.sight import Sights, spread_over
from aug3d_core.domes.site import Site, reduced
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import invert
from aug3d_core.geometry.views import Views

POINTS = 4000
LOWEST_DEG = 30.0  # directions nearer to the horizon are not asked for


@dataclass(frozen=True)
class Curve:
    """What is reached before the first view and after each, as shares of what can be seen: s is one more than the views."""

    sights: Float[np.ndarray, " s"]
    points: Float[np.ndarray, " s"]  # of the surface, from any direction


class Reach:
    """The sights of one scene, and those that its photographs have."""

    def __init__(self, mesh: Mesh, surface: Raycaster, photos: Views, site: Site, rng: np.random.Generator) -> None:
        """Spread points over the surface and look at them from the photos, as large as the virtual views."""
        self._surface = surface
        self._samples = spread_over(mesh, POINTS, site.limits, rng)
        justified = site.justified[self._samples.triangle]
        there = self._samples.open(surface, LOWEST_DEG) & (justified[:, None, None] <= site.limits)
        self._shape = there.shape
        self.open: Bool[np.ndarray, " u"] = there.ravel()
        # A point that is seen with pixels half as large shows four times as much
        fineness = (site.limits[-1] / site.limits) ** 2
        self.worth: Float[np.ndarray, " u"] = np.broadcast_to(fineness, there.shape).ravel()
        self.photographed: Bool[np.ndarray, " u"] = np.zeros_like(self.open)
        small = reduced(photos, site.size)
        for sights in self._seen(small.cam_from_world, small.intrinsics, small.size):
            self.photographed[sights] = True

    def of_domes(self, cameras: Cameras) -> list[list[Sights]]:
        """Return the open sights of each camera, dome by dome."""
        seen = self._seen(invert(cameras.world_from_cam[:, :3]), cameras.intrinsics, cameras.size)
        ends = np.flatnonzero(np.diff(cameras.dome_id)) + 1
        return [seen[a:b] for a, b in pairwise([0, *ends, len(seen)])] if seen else []

    def curve(self, views: Sequence[Sights]) -> Curve:
        """Return what photographs and then these views reach, one after the other."""
        covered = self.photographed.copy()
        sights, points = [], []
        for view in (np.zeros(0, int), *views):
            covered[view] = True
            sights.append(self.worth[covered].sum() / max(self.worth[self.open].sum(), 1.0))
            points.append(self._points(covered) / max(self._points(self.open), 1))
        return Curve(np.array(sights), np.array(points))

    def overlap(self, domes: Sequence[Sequence[Sights]]) -> float | None:
        """Return the mean share of a view's points that another view of its dome sees too; None where there are none."""
        shares = []
        for views in domes:
            points = [np.unique(sights // np.prod(self._shape[1:])) for sights in views]
            shares += [np.isin(a, b).mean() for a, b in permutations(points, 2) if len(a)]
        return float(np.mean(shares)) if shares else None

    def _seen(self, poses: np.ndarray, intrinsics: np.ndarray, size: np.ndarray) -> list[Sights]:
        seen = (self._samples.seen(self._surface, *camera) for camera in zip(poses, intrinsics, size, strict=True))
        return [sights[self.open[sights]] for sights in seen]

    def _points(self, sights: Bool[np.ndarray, " u"]) -> int:
        return int(sights.reshape(self._shape).any(axis=(1, 2)).sum())


def union(views: Sequence[Sights]) -> Sights:
    """Return what any of the views sees."""
    return np.unique(np.concatenate(views))
