"""The ground goes on where photos look but no point stands: lawn, asphalt and crowns that matched badly.

A photo that shows a surface everywhere is evidence that there is one; what is unknown is its height. It is taken from
the points around: a robust plane through all, plus the weighted mean of the nearest points' heights above it. This is
the ground model of a homography, so that the mesh is never less than that; how much of it is such a guess is reported.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from aug3d_core.geometry.transforms import apply
from aug3d_core.geometry.views import Views
from aug3d_core.surface.evidence import Evidence

NEAREST = 16  # points whose heights are averaged
OWN_GROUND = 3.0  # spacings around a point in which it speaks for itself
STEPS_PER_FOOTPRINT = 60
PLANE_ROUNDS = 10


def footprint(evidence: Evidence, views: Views) -> float:
    """Return the shorter side of the ground that a median photo shows (world units)."""
    depth = np.median(
        apply(views.cam_from_world, np.broadcast_to(evidence.xyz, (len(views), *evidence.xyz.shape)))[..., 2], 1
    )
    return float(np.median(depth * (views.size / views.intrinsics[:, :2]).min(axis=1)))


def continue_ground(evidence: Evidence, views: Views, reach: float) -> Evidence:
    """Return the points and, up to `reach` (world units) around them, ground that one of the views looks at."""
    xyz = evidence.xyz
    step = max(evidence.spacing, footprint(evidence, views) / STEPS_PER_FOOTPRINT)
    low, high = xyz[:, :2].min(axis=0) - reach, xyz[:, :2].max(axis=0) + reach
    xy = np.stack(np.meshgrid(*(np.arange(a, b, step) for a, b in zip(low, high, strict=True))), -1).reshape(-1, 2)
    distance, index = map(np.asarray, KDTree(xyz[:, :2]).query(xy, NEAREST))
    wanted = (distance[:, 0] > max(OWN_GROUND * evidence.spacing, step)) & (distance[:, 0] <= reach)
    xy, distance, index = xy[wanted], distance[wanted], index[wanted]
    plane = robust_plane(xyz)
    above = xyz[:, 2] - height_on(plane, xyz[:, :2])
    weight = 1 / distance**2
    height = height_on(plane, xy) + (weight * above[index]).sum(axis=1) / weight.sum(axis=1)
    guess = np.column_stack([xy, height])
    guess = guess[_seen(guess, views)]
    up = np.array([-plane[0], -plane[1], 1.0]) / np.sqrt(1 + plane[0] ** 2 + plane[1] ** 2)
    normals = np.broadcast_to(up, guess.shape)
    return Evidence(np.concatenate([xyz, guess]), np.concatenate([evidence.normals, normals]), evidence.spacing)


def robust_plane(xyz: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, " 3"]:
    """Fit z = a x + b y + c with small weight on what stands far off (iterated least squares, Cauchy weights)."""
    design = np.column_stack([xyz[:, :2], np.ones(len(xyz))])
    weight = np.ones(len(xyz))
    for _ in range(PLANE_ROUNDS):
        root = np.sqrt(weight)
        plane = np.linalg.lstsq(design * root[:, None], xyz[:, 2] * root, rcond=None)[0]
        error = xyz[:, 2] - design @ plane
        weight = 1 / (1 + (error / max(1.4826 * float(np.median(np.abs(error))), 1e-9)) ** 2)
    return plane


def height_on(plane: Float[np.ndarray, " 3"], xy: Float[np.ndarray, "p 2"]) -> Float[np.ndarray, " p"]:
    """Return the plane's height at places."""
    return xy @ plane[:2] + plane[2]


def guessed(xyz: Float[np.ndarray, "v 3"], evidence: Evidence) -> Bool[np.ndarray, " v"]:
    """Tell which places no point of the photos speaks for."""
    return KDTree(evidence.xyz).query(xyz)[0] > 2 * OWN_GROUND * evidence.spacing


def _seen(xyz: np.ndarray, views: Views) -> np.ndarray:
    """Tell which places lie in the image of a view."""
    seen = np.zeros(len(xyz), bool)
    for pose, (fx, fy, cx, cy), size in zip(views.cam_from_world, views.intrinsics, views.size, strict=True):
        in_cam = apply(pose, xyz)
        depth = np.where(in_cam[:, 2] > 0, in_cam[:, 2], np.inf)
        xy = in_cam[:, :2] / depth[:, None] * (fx, fy) + (cx, cy)
        seen |= np.isfinite(depth) & (xy > 0).all(axis=1) & (xy < size).all(axis=1)
    return seen
