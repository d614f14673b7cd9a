"""Camera poses on a piece of a sphere, looking at its centre."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.transforms import look_at


def directions(
    count: int, elevation_deg: tuple[float, float], azimuth_deg: tuple[float, float], rng: np.random.Generator
) -> Float[np.ndarray, "n 3"]:
    """Draw unit vectors from a centre to cameras, uniform by area; azimuth is counted from +x towards +y."""
    # Equal steps of the sine of elevation are equal areas of the sphere (Archimedes)
    lowest, highest = np.sin(np.radians(elevation_deg))
    sine = rng.uniform(lowest, highest, count)
    azimuth = np.radians(rng.uniform(azimuth_deg[0], azimuth_deg[1], count))
    cosine = np.sqrt(1 - sine**2)
    return np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine], axis=1)


def looking_at(
    centre: Float[np.ndarray, " 3"], direction: Float[np.ndarray, "n 3"], radius: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3 4"]:
    """Return `cam_from_world` of cameras that look at the centre from these directions and distances, level."""
    places = centre + radius[:, None] * direction
    return np.stack([look_at(place, centre) for place in places])
