"""Where the drone was: its path, flown a little unsteadily, in the world frame (ENU metres)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.views import Views
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.paths import PATHS
from aug3d_core.town.generator.terrain import HILLS, Terrain

SECONDS_PER_PHOTO = 3

_UNSTEADY_M = 0.6
_UNSTEADY_DEG = (1.2, 1.2, 2.5)  # pitch, roll, heading


def plan_flight(config: TownConfig, rng: np.random.Generator, terrain: Terrain = HILLS) -> Views:
    """Return the true cameras in the order of capture."""
    poses = []
    for station in list(PATHS[config.path](config, rng))[: config.max_photos]:
        z = station.altitude_m + terrain.trend_in_world(station.x, station.y)
        centre = np.array([station.x, station.y, z]) + rng.normal(0, _UNSTEADY_M, 3)
        heading = np.array([station.heading_x, station.heading_y, 0.0])
        poses.append(_pose(centre, heading, station.tilt_deg, rng))
    n, width, height = len(poses), config.width_px, config.height_px
    intrinsics = np.array([config.focal_px, config.focal_px, width / 2, height / 2])
    return Views(np.arange(n), np.stack(poses), np.tile(intrinsics, (n, 1)), np.tile([width, height], (n, 1)))


def _pose(
    centre_in_world: Float[np.ndarray, " 3"],
    heading: Float[np.ndarray, " 3"],
    tilt_deg: float,
    rng: np.random.Generator,
) -> Float[np.ndarray, "3 4"]:
    """Return `cam_from_world` of a camera with the heading at the top of its picture."""
    tilt = np.radians(tilt_deg)
    z = np.sin(tilt) * heading - np.cos(tilt) * np.array([0.0, 0.0, 1.0])
    x = np.cross(heading, [0.0, 0.0, 1.0])
    rotation = _small_rotation(np.radians(_UNSTEADY_DEG) * rng.normal(size=3)) @ np.stack([x, np.cross(z, x), z])
    return np.concatenate([rotation, (-rotation @ centre_in_world)[:, None]], axis=1)


def _small_rotation(angles_rad: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Rotate about the camera's x, y and z axis in turn."""
    rotation = np.eye(3)
    for axis, angle in enumerate(angles_rad):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
        rotation = turn @ rotation
    return rotation
