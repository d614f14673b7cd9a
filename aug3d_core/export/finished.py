"""What exports of the mesh read of a finished scene: the mesh that covers the ground of the test too, and where it lies."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.run.errors import StoreError
from aug3d_core.sfm.files import WORLD
from aug3d_core.surface.files import BASELINE_MESH, BASELINE_MESH_TEXTURE, BASELINE_TEXTURED_MESH

MESH_FILES = (BASELINE_MESH, BASELINE_MESH_TEXTURE, BASELINE_TEXTURED_MESH)


def mesh_of(surface: Path) -> TexturedMesh | Mesh:
    """Return the mesh of all photographs but those held out, with its texture if it has one; raises StoreError."""
    plain = required(surface / BASELINE_MESH)  # always written; without it the rest is not to be trusted
    if (surface / BASELINE_TEXTURED_MESH).is_file():
        return TexturedMesh.load(surface / BASELINE_TEXTURED_MESH, surface / BASELINE_MESH_TEXTURE)
    return Mesh.load(plain)


def world_of(sfm: Path) -> tuple[dict[str, Any], Float[np.ndarray, " 3"] | None]:
    """Return what is told of a scene's world, and its origin's latitude, longitude and altitude; None where no GPS told it.

    The altitude is 0 where nothing told it (`altitude_told`): altitudes on earth then are heights above the world's zero.
    Raises StoreError if it is missing.
    """
    world = json.loads(required(sfm / WORLD).read_text())
    told = world["origin"] if world["metric"] else None
    return world, np.array([told["lat_deg"], told["lon_deg"], told["alt_m"] or 0.0]) if told else None


def altitude_told(world: Mapping[str, Any]) -> bool:
    """Tell whether the altitude of a world's origin is known: GPS may tell places without."""
    return bool(world["metric"] and world["origin"]) and world["origin"]["alt_m"] is not None


def required(path: Path) -> Path:
    """Return the path of a file; raises StoreError if there is none."""
    if not path.is_file():
        raise StoreError(f"{path} is missing", "run the scene again, then export it")
    return path
