"""The files that the stages of this package write."""

from __future__ import annotations

from aug3d_core.photos.files import image_name

DENSE_WORKSPACE = "workspace"
WORKSPACE_DEPTH_MAPS = "stereo/depth_maps"
WORKSPACE_NORMAL_MAPS = "stereo/normal_maps"
RAW = "raw"  # while the stage works
DEPTH_MAPS = f"{DENSE_WORKSPACE}/{WORKSPACE_DEPTH_MAPS}"
NORMAL_MAPS = f"{DENSE_WORKSPACE}/{WORKSPACE_NORMAL_MAPS}"
FUSED = "fused.npz"
BASELINE_FUSED = "baseline_fused.npz"
FUSED_TILES = "fused_tiles"  # while the stage works
DEPTH_SHEET = "depth_and_normals.png"
MADE_OF = "made_of.json"  # of a sweep: what the maps of each photograph depend on


def geometric_map_name(photo_id: int) -> str:
    """Name of a photograph's file inside COLMAP's `depth_maps/` and `normal_maps/`."""
    return f"{image_name(photo_id)}.geometric.bin"


def planes_name(photo_id: int) -> str:
    """Name of the file beside a photograph's raw map that says how many planes were tried: written after it, kept longer."""
    return f"{image_name(photo_id)}.planes"
