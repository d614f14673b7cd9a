"""Oriented points to a closed surface (screened Poisson), as fine as the points are dense."""

from __future__ import annotations

import math

import numpy as np
import open3d as o3d

from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.shape import Shape

MIN_DEPTH, MAX_DEPTH = 5, 11
SCALE = 1.1  # the octree's cube over the points' cube, at least
# Four points a cell: finer cells model the points' noise. To the bit, in a larger cube: halving the points' own cube gives 1.4
# to 2.8, and neighbouring tiles need equal cells
CELL_SPACINGS = 2.0
# How much the surface follows the points; open3d's choice
POINT_WEIGHT = 2.0


def reconstruct(evidence: Evidence) -> Shape:
    """Return Poisson's surface through the points, untrimmed. The finest cells are CELL_SPACINGS wide."""
    cells, depth = _cells(evidence), octree_depth(evidence)
    origin = evidence.xyz.mean(axis=0)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(evidence.xyz - origin))
    cloud.normals = o3d.utility.Vector3dVector(evidence.normals)
    # One thread: with more, the order of sums and so the bytes change from run to run
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud, depth=depth, scale=SCALE * max(1.0, 2**depth / cells), n_threads=1, point_weight=POINT_WEIGHT
    )
    return _shape(mesh, origin)


def octree_depth(evidence: Evidence) -> int:
    """Return the depth of the smallest octree with cells of CELL_SPACINGS that holds the points."""
    return int(np.clip(math.ceil(math.log2(_cells(evidence))), MIN_DEPTH, MAX_DEPTH))


def _cells(evidence: Evidence) -> float:
    """Return how many cells of CELL_SPACINGS the cube is wide."""
    return float(np.ptp(evidence.xyz, axis=0).max()) * SCALE / (CELL_SPACINGS * evidence.spacing)


def simplify(shape: Shape, triangles: int) -> Shape:
    """Decimate by quadric error to at most about `triangles`."""
    if len(shape.triangles) <= triangles:
        return shape
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(shape.xyz), o3d.utility.Vector3iVector(shape.triangles))
    return _shape(mesh.simplify_quadric_decimation(triangles), np.zeros(3))


def _shape(mesh: o3d.geometry.TriangleMesh, origin: np.ndarray) -> Shape:
    return Shape(np.asarray(mesh.vertices) + origin, np.asarray(mesh.triangles).astype(np.int32))
