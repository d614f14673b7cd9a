"""Domes over the cells of one grid.

The cells' side is chosen so that about the wanted number of them can have a dome. Its radius is that at which the cell
fills the view, but where cells are small it is that of the finest sampling that the photos justify; neighbours then
overlap.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.sampling.cameras import Cameras, Dome, Plan
from aug3d_core.sampling.conditioning import usable
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sampling.dome import directions, looking_at
from aug3d_core.sampling.ground import Ground
from aug3d_core.sampling.site import Site
from aug3d_core.surface.raycast import Raycaster

SIDES_TRIED = 120
CLOSEST = 0.2  # least distance of two domes, as a share of what the nearest view shows


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan the cameras of all domes; cells that cannot have one are in the answer with the reason."""
    side = choose_side(site, config)
    domes, poses = [], []
    for centre in cell_centres(site.ground, side):
        dome, cameras = _place(surface, site, config, rng, centre, side)
        domes.append(dome)
        if len(cameras):
            poses.append(cameras)
    return Plan(_table(poses, site), tuple(domes))


def choose_side(site: Site, config: SamplingConfig) -> float:
    """Return the cell side (world units) that gives the number of usable cells nearest to the wanted one."""
    ground = site.ground
    largest = float(ground.extent.max())
    smallest = min(max(CLOSEST * looked_at(site, 0.0), ground.square), largest)
    sides = np.geomspace(largest, smallest, SIDES_TRIED)
    counts = [(_covered(site, cell_centres(ground, s), s) >= config.min_cell_covered).sum() for s in sides]
    return float(sides[np.argmin(np.abs(np.array(counts) - config.domes))])


def looked_at(site: Site, side: float) -> float:
    """Return how wide the ground is that the nearest camera over a cell shows (world units)."""
    return max(side, site.finest_sampling * float(site.size.max()))


def cell_centres(ground: Ground, side: float) -> Float[np.ndarray, "n 2"]:
    """Return the cells' centres, row by row from the south-west; the grid is centred on the ground."""
    count = np.maximum(np.ceil(ground.extent / side - 1e-6).astype(int), 1)
    middle = ground.low + ground.extent / 2
    x, y = (middle[axis] + side * (np.arange(count[axis]) - (count[axis] - 1) / 2) for axis in (0, 1))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _covered(site: Site, centres: Float[np.ndarray, "n 2"], side: float) -> Float[np.ndarray, " n"]:
    return site.ground.covered_share(centres, looked_at(site, side))


def _place(
    surface: Raycaster,
    site: Site,
    config: SamplingConfig,
    rng: np.random.Generator,
    centre: Float[np.ndarray, " 2"],
    side: float,
) -> tuple[Dome, Float[np.ndarray, "k 3 4"]]:
    """Put a dome on a cell; no cameras if it has to be passed over."""
    nearest = looked_at(site, side) * site.focal_px / float(site.size.max())
    covered = float(_covered(site, centre[None], side)[0])
    seen = f"surface under {100 * covered:.0f} % of the view"

    def dome(height: float, views: int, why: str) -> Dome:
        return Dome(float(centre[0]), float(centre[1]), height, nearest, side, views, why)

    if covered < config.min_cell_covered:
        return dome(float("nan"), 0, f"passed over: {seen}"), np.zeros((0, 3, 4))
    height, wanted = _height(site.ground, centre, side), site.views_per_dome
    cameras, radius = _draw(np.append(centre, height), nearest, wanted * config.tries, config, rng)
    cameras = cameras[usable(surface, cameras, radius, site, config)][:wanted]
    if len(cameras) < wanted:
        why = f"passed over: only {len(cameras)} of {len(radius)} cameras tried are free and see enough surface"
        return dome(height, 0, why), np.zeros((0, 3, 4))
    return dome(height, wanted, seen), cameras


def _height(ground: Ground, centre: np.ndarray, side: float) -> float:
    """Return the surface's median height in the middle of a cell, or in all of it where the middle is a hole."""
    middle, whole = ground.window(centre, side / 4), ground.window(centre, side)
    return float(np.nanmedian(middle if np.isfinite(middle).any() else whole))


def _draw(
    aim: Float[np.ndarray, " 3"], nearest: float, count: int, config: SamplingConfig, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3 4"], Float[np.ndarray, " n"]]:
    """Draw cameras in one sector of the dome, which is turned at random so that the scene is seen from all sides."""
    heading = rng.uniform(0, 360)
    sector = (heading - config.azimuth_range_deg / 2, heading + config.azimuth_range_deg / 2)
    radius = nearest * rng.uniform(1.0, 1.0 + config.radius_spread, count)
    direction = directions(count, (config.min_elevation_deg, config.max_elevation_deg), sector, rng)
    return looking_at(aim, direction, radius), radius


def _table(poses: list[Float[np.ndarray, "k 3 4"]], site: Site) -> Cameras:
    count = sum(len(cameras) for cameras in poses)
    return Cameras(
        view_id=np.arange(count),
        dome_id=np.repeat(np.arange(len(poses)), [len(cameras) for cameras in poses]),
        world_from_cam=homogeneous(invert(np.concatenate([np.zeros((0, 3, 4)), *poses]))),
        intrinsics=np.tile(site.intrinsics, (count, 1)),
        size=np.tile(site.size, (count, 1)),
    )
