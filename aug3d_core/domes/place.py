"""One dome over a place: its cameras, or the reason why it has none. Every sampler puts its domes through here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from aug3d_core.domes.cameras import Cameras, Dome, Plan
from aug3d_core.domes.conditioning import GOOD, REASONS, faults
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.dome import directions, looking_at
from aug3d_core.domes.height_raster import HeightRaster
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import homogeneous, invert

FAIR_TRIAL = 3  # turns after which a place is given up, if at that rate it will not have enough cameras

NONE: Mapping[str, int] = MappingProxyType(dict.fromkeys(REASONS, 0))

Draw = Callable[[int], Float[np.ndarray, "n 3"]]  # unit vectors from the dome's centre to so many cameras
Placed = tuple[Dome, Float[np.ndarray, "_ 3 4"]]  # no cameras where the place is passed over


def dome_over(
    surface: Raycaster,
    site: Site,
    config: SamplingConfig,
    rng: np.random.Generator,
    centre: Float[np.ndarray, " 2"],
    side: float,
    what: str,
    draw: Draw | None = None,
) -> Placed:
    """Put a dome over a square of the ground (x, y of its middle; world units); `what` names the square in `why`.

    `draw` tells where on the dome cameras may stand; without it that is one sector, turned at random so that the scene
    is seen from all sides.

    The dome's radius is that at which the square fills the view, or that of the finest sampling that the photos justify
    where the square is smaller.
    """
    nearest = looked_at(site, side) * site.focal_px / float(site.size.max())
    covered = float(covered_share(site, centre[None], side)[0])
    seen = f"surface under {100 * covered:.0f} % of the view"

    def dome(height: float, views: int, why: str, tried: int = 0, rejected: Mapping[str, int] = NONE) -> Dome:
        return Dome(float(centre[0]), float(centre[1]), height, nearest, side, views, why, tried, rejected)

    if covered < config.min_cell_covered:
        return dome(float("nan"), 0, f"{what}, passed over: {seen}"), np.zeros((0, 3, 4))
    height = _height(site.ground, centre, side)
    draw = draw or _in_a_sector(config, rng)
    cameras, tally = _find(surface, site, config, rng, np.append(centre, height), nearest, draw)
    found, tried = len(cameras), len(cameras) + sum(tally.values())
    if found < site.views_per_dome:
        most = max(tally, key=lambda reason: tally[reason])
        why = (
            f"{what}, passed over: of {tried} cameras tried {found} can be used; most others: {most.replace('_', ' ')}"
        )
        return dome(height, 0, why, tried, tally), np.zeros((0, 3, 4))
    kept = cameras[: site.drawn_per_dome]
    return dome(height, len(kept), f"{what}: {seen}", tried, tally), kept


def plan_of(placed: Iterable[Placed], site: Site) -> Plan:
    """Return the plan of all domes, in this order."""
    placed = list(placed)
    poses = [cameras for _, cameras in placed if len(cameras)]
    count = sum(len(cameras) for cameras in poses)
    cameras = Cameras(
        view_id=np.arange(count),
        dome_id=np.repeat(np.arange(len(poses)), [len(cameras) for cameras in poses]),
        world_from_cam=homogeneous(invert(np.concatenate([np.zeros((0, 3, 4)), *poses]))),
        intrinsics=np.tile(site.intrinsics, (count, 1)),
        size=np.tile(site.size, (count, 1)),
    )
    return Plan(cameras, tuple(dome for dome, _ in placed))


def looked_at(site: Site, side: float) -> float:
    """Return how wide the ground is that the nearest camera over a square shows (world units)."""
    return max(side, site.finest_sampling * float(site.size.max()))


def covered_share(site: Site, centres: Float[np.ndarray, "n 2"], side: float) -> Float[np.ndarray, " n"]:
    """Return the share of what the nearest cameras over these squares look at that has surface."""
    return site.ground.covered_share(centres, looked_at(site, side))


def _height(ground: HeightRaster, centre: np.ndarray, side: float) -> float:
    """Return the surface's median height in the middle of a square, or in all of it where the middle is a hole."""
    middle, whole = ground.window(centre, side / 4), ground.window(centre, side)
    return float(np.nanmedian(middle if np.isfinite(middle).any() else whole))


def _in_a_sector(config: SamplingConfig, rng: np.random.Generator) -> Draw:
    heading, half = rng.uniform(0, 360), config.azimuth_range_deg / 2
    elevation = (config.min_elevation_deg, config.max_elevation_deg)
    return lambda count: directions(count, elevation, (heading - half, heading + half), rng)


def _find(
    surface: Raycaster,
    site: Site,
    config: SamplingConfig,
    rng: np.random.Generator,
    aim: Float[np.ndarray, " 3"],
    nearest: float,
    draw: Draw,
) -> tuple[Float[np.ndarray, "n 3 4"], dict[str, int]]:
    """Draw cameras until enough can be used or too many were tried; return the usable ones, and the others by reason."""
    wanted = site.drawn_per_dome
    found, tally = np.zeros((0, 3, 4)), np.zeros(len(REASONS), int)
    for turn in range(1, config.tries + 1):
        radius = nearest * rng.uniform(1.0, 1.0 + config.radius_spread, wanted)
        drawn = looking_at(aim, draw(wanted), radius)
        fault = faults(surface, drawn, radius, site, config)
        found = np.concatenate([found, drawn[fault == GOOD]])
        tally += np.bincount(fault[fault != GOOD], minlength=len(REASONS))
        hopeless = turn >= FAIR_TRIAL and len(found) * config.tries < turn * site.views_per_dome
        if len(found) >= wanted or hopeless:
            break
    return found, dict(zip(REASONS, tally.tolist(), strict=True))
