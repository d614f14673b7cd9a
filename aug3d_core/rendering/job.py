"""What a worker renders: meshes, cameras, light. Written as JSON; arrays stay in the files it names.

Cameras are an `.npz` of `view_id` (M,), `world_from_cam` (M,4,4), `intrinsics` (M,4: fx, fy, cx, cy) and `size` (M,2:
width, height), in COLMAP's convention: x right, y down, z forward, pixel centres at half-integers.

A mesh is a PLY with vertex colours, or an `.npz` of `vertices` (V,3), `triangles` (T,3) and `uv` (T,3,2; v up) for a
texture. Colours and textures are 8-bit sRGB.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from aug3d_core.stage import Frozen


class Emission(Frozen):
    """Surfaces shine in their own colour: what was photographed comes out unchanged, with no shading."""

    kind: Literal["emission"] = "emission"


class Sunlit(Frozen):
    """Matt surfaces under a sun and an even sky, in relative strengths."""

    kind: Literal["sunlit"] = "sunlit"
    sun_azimuth_deg: float = Field(description="Direction to the sun, clockwise from north (+y).")
    sun_elevation_deg: float = Field(gt=0, le=90, description="Height of the sun over the horizon.")
    sun_colour: tuple[float, float, float] = (1.0, 0.94, 0.84)
    sun_strength: float = 4.0
    sky_colour: tuple[float, float, float] = (0.62, 0.76, 1.0)
    sky_strength: float = 0.39
    fill: float = Field(
        default=0.15, ge=0, description="Light that reaches every surface alike, for all later bounces."
    )


class MeshFile(Frozen):
    """One mesh and, if it has texture coordinates, the picture they point into."""

    path: Path
    texture: Path | None = None


class RenderJob(Frozen):
    """One shard: the views `first` to `last` (exclusive) of a camera file, written to `out` in one piece."""

    meshes: tuple[MeshFile, ...]
    cameras: Path
    first: int = Field(ge=0)
    last: int = Field(ge=1)
    out: Path
    samples: int = Field(ge=1)
    light: Emission | Sunlit = Field(default=Emission(), discriminator="kind")
    depth: bool = Field(
        default=True, description="Whether the shard holds depth, which costs a second render of a ray per pixel."
    )
    seed: int = 0
