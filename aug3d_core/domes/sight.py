"""What cameras see: sample points of the surface, each from one of a few directions, more or less finely.

A sight is a point seen from a direction with pixels no larger than a limit, numbered
`(point * DIRECTIONS + direction) * limits + limit`; who sees finely has the coarser sights too. Points are spread evenly
over the surface, so that the share of sights is a share of area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import apply, centres, project

Sights = Int[np.ndarray, " _"]  # of one view: another view has another number of them

DIRECTIONS = 64  # of the whole sphere: neighbours are some 28 degrees apart
STEEPEST = np.cos(np.radians(80.0))  # a surface seen more aslant shows nothing
GAP = 1e-3  # of the way to a point: what is hit so close before it is the point's own surface


@dataclass(frozen=True)
class Samples:
    """Points spread over a surface, and the limits that say how finely they are seen."""

    xyz: Float[np.ndarray, "p 3"]
    normal: Float[np.ndarray, "p 3"]
    triangle: Int[np.ndarray, " p"]
    limits: Float[np.ndarray, " l"]  # world units per px

    def open(self, surface: Raycaster, lowest_deg: float) -> Bool[np.ndarray, "p d l"]:
        """Tell which sights there are at all: the direction is high enough, before the surface, and free to the sky."""
        answer = np.zeros((len(self.xyz), DIRECTIONS, len(self.limits)), bool)
        for direction in np.flatnonzero(SPREAD[:, 2] >= np.sin(np.radians(lowest_deg))):
            away = SPREAD[direction]
            facing = np.flatnonzero(self.normal @ away > STEEPEST)
            origins = self.xyz[facing] + GAP * np.ptp(self.xyz) * away
            answer[facing, direction] = (surface.cast(origins, away).triangle < 0)[:, None]
        return answer

    def seen(
        self,
        surface: Raycaster,
        cam_from_world: Float[np.ndarray, "3 4"],
        intrinsics: Float[np.ndarray, " 4"],
        size: Int[np.ndarray, " 2"],
    ) -> Sights:
        """Return the sights of a camera."""
        point, depth, towards = self.visible(surface, cam_from_world, intrinsics, size, STEEPEST)
        direction = (towards @ SPREAD.T).argmax(axis=1)
        row, limit = np.nonzero(depth[:, None] / intrinsics[0] <= self.limits)
        return (point[row] * DIRECTIONS + direction[row]) * len(self.limits) + limit

    def visible(
        self,
        surface: Raycaster,
        cam_from_world: Float[np.ndarray, "3 4"],
        intrinsics: Float[np.ndarray, " 4"],
        size: Int[np.ndarray, " 2"],
        steepest: float,
    ) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, " s"], Float[np.ndarray, "s 3"]]:
        """Return the points that a camera sees, their depths, and the unit vectors from them to it.

        steepest: least cosine of the angle between that vector and the surface's normal.
        """
        inside, depth = framed(self.xyz, cam_from_world, intrinsics, size)
        to_point = self.xyz[inside] - centres(cam_from_world)
        towards = -to_point / np.linalg.norm(to_point, axis=1, keepdims=True)
        facing = np.einsum("pk,pk->p", towards, self.normal[inside]) > steepest
        free = facing.copy()
        free[facing] = ~surface.occluded(centres(cam_from_world), to_point[facing], 1 - GAP)
        return inside[free], depth[free], towards[free]


def framed(
    xyz: Float[np.ndarray, "p 3"],
    cam_from_world: Float[np.ndarray, "3 4"],
    intrinsics: Float[np.ndarray, " 4"],
    size: Int[np.ndarray, " 2"],
) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, " s"]]:
    """Return the points that lie in a camera's frame, hidden or not, and their depths."""
    in_cam = apply(cam_from_world, xyz)
    in_front = np.flatnonzero(in_cam[:, 2] > 0)
    xy = project(in_cam[in_front], intrinsics)
    inside = in_front[((xy >= 0) & (xy < size)).all(axis=1)]
    return inside, in_cam[inside, 2]


def spread_over(mesh: Mesh, count: int, limits: Float[np.ndarray, " l"], rng: np.random.Generator) -> Samples:
    """Draw points, uniform by area."""
    corners = mesh.xyz[mesh.triangles].astype(float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    chosen = np.sort(rng.choice(len(area), count, p=area / area.sum()))
    # Uniform in a triangle: Turk, "Generating random points in triangles", Graphics Gems (1990)
    root, t = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
    weights = np.stack([1 - root, root * (1 - t), root * t], axis=1)
    xyz = np.einsum("pk,pkx->px", weights, corners[chosen])
    return Samples(xyz, across[chosen] / area[chosen, None], chosen, limits)


def sphere(count: int) -> Float[np.ndarray, "d 3"]:
    """Return unit vectors spread over the sphere: the Fibonacci lattice."""
    z = 1 - (2 * np.arange(count) + 1) / count
    azimuth = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z**2) * np.cos(azimuth), np.sqrt(1 - z**2) * np.sin(azimuth), z], axis=1)


SPREAD = sphere(DIRECTIONS)
