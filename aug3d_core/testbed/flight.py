"""Where the drone was: a lawnmower grid of tilted, slightly unsteady photographs, in the world frame (ENU metres)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.views import Views
from aug3d_core.testbed.config import TownConfig

SECONDS_PER_PHOTO = 3

ORIGIN_GEODETIC = (46.9, 7.5, 540.0)  # the world's origin: latitude, longitude (degrees), altitude (m); open country

_UNSTEADY_M = 0.6
_UNSTEADY_DEG = (1.2, 1.2, 2.5)  # pitch, roll, heading


def plan_flight(config: TownConfig, rng: np.random.Generator) -> Views:
    """Return the true cameras in the order of capture."""
    width, height = config.width_px, config.height_px
    footprint_x = config.altitude_m * width / config.focal_px  # across the line of flight
    footprint_y = config.altitude_m * height / config.focal_px
    ahead = config.altitude_m * np.tan(np.radians(config.tilt_deg))
    along = _spread(config.length_m - 0.85 * footprint_y, (1 - config.forward_overlap) * footprint_y)
    lines = _spread(config.width_m - 0.85 * footprint_x, (1 - config.side_overlap) * footprint_x)
    poses = []
    for i, y in enumerate(lines):
        sense = 1.0 if i % 2 == 0 else -1.0
        for x in along[:: int(sense)]:
            centre = np.array([x - sense * ahead, y, config.altitude_m]) + rng.normal(0, _UNSTEADY_M, 3)
            poses.append(_pose(centre, np.array([sense, 0.0, 0.0]), config.tilt_deg, rng))
    n = len(poses)
    intrinsics = np.array([config.focal_px, config.focal_px, width / 2, height / 2])
    return Views(np.arange(n), np.stack(poses), np.tile(intrinsics, (n, 1)), np.tile([width, height], (n, 1)))


def _spread(room_m: float, step_m: float) -> Float[np.ndarray, " n"]:
    """Return positions `step_m` apart and centred on 0 that fill the room; at least two."""
    count = max(2, 1 + round(room_m / step_m))
    return (np.arange(count) - (count - 1) / 2) * step_m


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
