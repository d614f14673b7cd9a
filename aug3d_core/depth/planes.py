"""Families of parallel planes to try, no more than the photographs can tell apart. Plain numpy.

A family is a normal n in the reference camera's frame and a range of distances d: the planes are n . X = d, so that the
depth at a pixel with ray r (z = 1) is d / (n . r). Distances step evenly in 1/d, which moves a source pixel evenly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.depth.cameras import Camera, relative_pose

MOST_PLANES = 1024  # a source that nearly touches what it sees would ask for any number
_PROBES = 5  # pixels along each side of the reference at which shifts are measured
_STEPS = 32


@dataclass(frozen=True)
class Family:
    """Parallel planes, nearest last."""

    normal: Float[np.ndarray, " 3"]
    inverse_distance: Float[np.ndarray, " k"]


def horizontal_normal(camera: Camera) -> Float[np.ndarray, " 3"]:
    """Return the downward vertical in the camera's frame."""
    return -camera.cam_from_world[:, 2]


def make_family(
    reference: Camera,
    sources: list[Camera],
    normal: Float[np.ndarray, " 3"],
    nearest: float,
    farthest: float,
    step_px: float,
) -> Family:
    """Return planes from `farthest` to `nearest`, no source pixel moving more than `step_px` between two."""
    inverse = np.linspace(1 / farthest, 1 / nearest, _STEPS + 1)
    path = max(_path_px(reference, source, normal, inverse) for source in sources)
    count = int(np.clip(np.ceil(path / step_px) + 1, 3, MOST_PLANES))
    return Family(normal, np.linspace(1 / farthest, 1 / nearest, count))


def _path_px(reference: Camera, source: Camera, normal: np.ndarray, inverse: np.ndarray) -> float:
    """Return how far a source pixel travels over the whole range: 90th percentile over the reference's pixels."""
    rays = reference.rays[:: max(1, reference.height // _PROBES), :: max(1, reference.width // _PROBES)].reshape(-1, 3)
    rotation, translation = relative_pose(reference, source)
    depth = 1 / (inverse[:, None] * (rays @ normal))
    points = (depth[..., None] * rays) @ rotation.T + translation
    ahead = (points[..., 2] > 0).all(axis=0) & (depth > 0).all(axis=0)
    if not ahead.any():
        return 0.0
    pixels = points[:, ahead, :2] / points[:, ahead, 2:] * source.intrinsics[:2]
    length = np.linalg.norm(np.diff(pixels, axis=0), axis=-1) * len(inverse[1:])
    return float(np.percentile(length.max(axis=0), 90))
