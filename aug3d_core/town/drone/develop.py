"""From a render to the JPEG: sky, moving water, lens, blur, exposure, noise and EXIF, each as the flight's settings say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8

from aug3d_core.geometry.transforms import invert
from aug3d_core.geometry.views import Views
from aug3d_core.town.drone.lens import Lens
from aug3d_core.town.drone.photo import Stamp, save_photo
from aug3d_core.town.drone.sensor import Defects, blur, expose, over_sky, ripple
from aug3d_core.town.generator.terrain import Terrain, unbend_xy


@dataclass(frozen=True)
class Darkroom:
    """What turns the renders of one flight into its photographs.

    views: the pinhole cameras that were rendered; wider than the photographs if the lens bends.
    """

    views: Views
    terrain: Terrain
    lens: Lens
    defects: Defects
    stamps: list[Stamp]
    noise_levels: float
    seed: int

    def develop(self, rgb: UInt8[np.ndarray, "h w 3"], alpha: UInt8[np.ndarray, "h w"], view: int, path: Path) -> None:
        """Write one photograph."""
        image = self.exposed(rgb, alpha, view)
        save_photo(path, image, self.stamps[view], self.noise_levels, np.random.default_rng([self.seed, view]))

    def exposed(
        self, rgb: UInt8[np.ndarray, "h w 3"], alpha: UInt8[np.ndarray, "h w"], view: int
    ) -> UInt8[np.ndarray, "H W 3"]:
        """Return what falls on the sensor, before its noise."""
        # Generators per photograph: its noise must not depend on which shards were rendered before.
        image = over_sky(rgb, alpha)
        if self.terrain.lake:
            image = ripple(
                image, lake_pixels(self.views, view, self.terrain), np.random.default_rng([self.seed, view, 1])
            )
        if self.lens.bends:
            image = self.lens.resample(image)
        return expose(blur(image, self.defects.blur_px[view]), self.defects.exposure[view])


def rendered_views(views: Views, lens: Lens) -> Views:
    """Return the pinhole cameras to render: those of the photographs, or wider ones for a lens that bends."""
    if not lens.bends:
        return views
    width, height = lens.wide_size()
    intrinsics = np.tile([lens.focal_px, lens.focal_px, width / 2, height / 2], (len(views), 1))
    return Views(views.photo_id, views.cam_from_world, intrinsics, np.tile([width, height], (len(views), 1)))


def lake_pixels(views: Views, view: int, terrain: Terrain) -> Bool[np.ndarray, "h w"]:
    """Tell where a view looks at the lake's plane within its shore, whatever stands before it."""
    if terrain.lake is None:
        return np.zeros(views.size[view][::-1], bool)
    world_from_cam, (fx, fy, cx, cy) = invert(views.cam_from_world[view]), views.intrinsics[view]
    width, height = views.size[view]
    u, v = np.meshgrid((np.arange(width) + 0.5 - cx) / fx, (np.arange(height) + 0.5 - cy) / fy)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ world_from_cam[:, :3].T
    down = rays[..., 2] < -1e-3
    at = world_from_cam[:, 3]
    reach = (terrain.water_level() - at[2]) / np.where(down, rays[..., 2], -1.0)
    places = (at[:2] + reach[..., None] * rays[..., :2]).reshape(-1, 2)
    beyond = np.asarray(terrain.lake.beyond_m(*unbend_xy(places).T)).reshape(height, width)
    return down & (beyond < 0)
