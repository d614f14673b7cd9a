"""A finished scene -> which photographs to take next, as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aug3d_core.advice.choice import Choice, chosen
from aug3d_core.advice.model_error import error_at
from aug3d_core.advice.route import along, cleared, route
from aug3d_core.advice.site import Site, site_of
from aug3d_core.export.finished import altitude_told, required, world_of
from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Points, Views
from aug3d_core.sfm.files import POINTS, VIEWS
from aug3d_core.surface.files import BASELINE_MESH

Progress = Callable[[str, int, int], None]  # what, done, total


@dataclass(frozen=True)
class Plan:
    """choice: its photographs in the order of the route, raised where a leg between them would pass too low.

    origin: latitude, longitude and altitude of the world's origin; None where no GPS told it. altitude: whether that told an
    altitude, too.
    """

    site: Site
    views: Views
    choice: Choice
    unit: str
    origin: Float[np.ndarray, " 3"] | None
    altitude: bool = True

    @property
    def lowest_ground(self) -> float:
        """The lowest height of the area and its surroundings: heights of missions count from it."""
        return self.site.area.lowest

    @property
    def clear_height(self) -> float:
        """The height above the lowest ground that keeps the margin above all of the area and its surroundings."""
        return self.site.floor - self.lowest_ground

    @property
    def above_ground(self) -> float:
        """The greatest height above the ground on the way through the photographs; 0 where there are none."""
        way = along(np.array([one.xyz for one in self.choice.advised]).reshape(-1, 3), self.site.area.cell)
        return float((way[:, 2] - self.site.ground.height_at(way[:, :2])).max(initial=0.0))

    @property
    def take_off_m(self) -> float | None:
        """The altitude below which nobody may take off, or the mission flies too low; None where no GPS told it."""
        if self.origin is None or not self.altitude:
            return None
        return float(geodetic_from_enu(np.array([0.0, 0.0, self.lowest_ground]), self.origin)[2])


def plan_of(
    sfm: Path,
    surface: Path,
    evaluations: Sequence[Path],
    count: int,
    margin_m: float,
    progress: Progress = lambda what, done, total: None,
) -> Plan:
    """Return so many photographs to take; raises StoreError if files are missing, InputError without ground."""
    views, points, (world, origin) = (
        Views.load(required(sfm / VIEWS)),
        Points.load(required(sfm / POINTS)),
        world_of(sfm),
    )
    mesh = Mesh.load(required(surface / BASELINE_MESH))
    site = site_of(mesh, views, points.xyz, margin_m if world["metric"] else None)
    error = error_at(site, views, evaluations)
    choice = chosen(site, views, error, count, progress)
    places = np.array([one.xyz for one in choice.advised]).reshape(-1, 3)
    order = route(places)
    flown = cleared(places[order], site.floor_at, site.area.cell).tolist()
    advised = (replace(choice.advised[i], xyz=(x, y, z)) for i, (x, y, z) in zip(order, flown, strict=True))
    choice = replace(choice, advised=tuple(advised))
    return Plan(site, views, choice, world["unit"], origin, altitude_told(world))
