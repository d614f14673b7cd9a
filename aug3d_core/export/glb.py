"""A scene's mesh with its texture -> one GLB file that Blender and browsers open, and where it lies.

glTF has y up: x is east, y up, z south. The mesh stands about its own middle, since programs count in single precision; the
offset file says where that is.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial

from aug3d_core.export.finished import MESH_FILES, altitude_told, mesh_of, world_of
from aug3d_core.export.target_folder import filling
from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.report.thumbnails import encoded
from aug3d_core.sfm.files import WORLD

MODEL, OFFSET = "mesh.glb", "offset.json"
READ = {"sfm": (WORLD,), "surface": MESH_FILES}  # stage -> files
_QUALITY = 90  # of the texture, a JPEG inside the file
_GLTF_FROM_WORLD = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True)
class GlbWritten:
    """What was written. triangles: of the mesh. texture_px: width and height of the texture, (0, 0) without one."""

    triangles: int
    texture_px: tuple[int, int]
    mib: float


def export_glb(sfm: Path, surface: Path, folder: Path) -> GlbWritten:
    """Write the mesh; raises UsageError if the folder is not empty, StoreError if files are missing."""
    with filling(folder):
        (world, origin), mesh = world_of(sfm), mesh_of(surface)
        middle = np.round((mesh.xyz.max(axis=0) + mesh.xyz.min(axis=0)).astype(float) / 2)
        model = glb_of(mesh, middle)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / MODEL).write_bytes(model)
        (folder / OFFSET).write_text(json.dumps(_offset(world, origin, middle), indent=1))
        size = mesh.texture.shape[1::-1] if isinstance(mesh, TexturedMesh) else (0, 0)
        return GlbWritten(len(mesh.triangles), (int(size[0]), int(size[1])), (folder / MODEL).stat().st_size / 2**20)


def glb_of(mesh: TexturedMesh | Mesh, middle_in_world: Float[np.ndarray, " 3"]) -> bytes:
    """Return a mesh as the bytes of a GLB file, y up, about a point."""
    with_skin = _with_texture if isinstance(mesh, TexturedMesh) else _with_colours
    return bytes(with_skin(mesh, middle_in_world).export(file_type="glb"))  # type: ignore[arg-type]


def _with_texture(mesh: TexturedMesh, middle: Float[np.ndarray, " 3"]) -> trimesh.Trimesh:
    """Return the mesh with a vertex for each place in space and texture: glTF has no coordinates of corners."""
    corners = np.column_stack([mesh.triangles.reshape(-1, 1), mesh.uv.reshape(-1, 2)])
    single, triangles = np.unique(corners, axis=0, return_inverse=True)
    picture = Image.open(io.BytesIO(encoded(Image.fromarray(mesh.texture), "JPEG", quality=_QUALITY)))
    material = PBRMaterial(baseColorTexture=picture, metallicFactor=0.0, roughnessFactor=1.0)
    xyz = mesh.xyz[single[:, 0].astype(int)]
    visual = TextureVisuals(uv=single[:, 1:], material=material)
    return trimesh.Trimesh(_local(xyz, middle), triangles.reshape(-1, 3), visual=visual, process=False)


def _with_colours(mesh: Mesh, middle: Float[np.ndarray, " 3"]) -> trimesh.Trimesh:
    made = trimesh.Trimesh(_local(mesh.xyz, middle), mesh.triangles, process=False)
    made.visual = ColorVisuals(made, vertex_colors=mesh.rgb)
    return made


def _local(xyz: Float[np.ndarray, "v 3"], middle: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "v 3"]:
    return (xyz - middle) @ _GLTF_FROM_WORLD.T


def _offset(
    world: Mapping[str, Any], origin: Float[np.ndarray, " 3"] | None, middle: Float[np.ndarray, " 3"]
) -> dict[str, Any]:
    """Say where the middle of the model is: in the scene's world, and on earth where GPS told; its altitude may be null."""
    on_earth = None if origin is None else geodetic_from_enu(middle, origin).tolist()
    if on_earth and not altitude_told(world):
        on_earth[2] = None
    return {
        "unit": world["unit"],
        "axes": "x east, y up, z south" if origin is not None else "x, y up, -z: x, z, y of the scene's world",
        "middle_in_world": middle.tolist(),
        "middle_lat_lon_alt": on_earth,
    }
