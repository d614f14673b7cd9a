"""What a worker renders: meshes, cameras, light. Written as JSON; arrays are in the files that it names.

Cameras are an `.npz` of `view_id` (M,), `world_from_cam` (M,4,4), `intrinsics` (M,4: fx, fy, cx, cy) and `size` (M,2:
width, height), in COLMAP's convention: x right, y down, z forward, pixel centres at half-integers.

A mesh is a PLY with vertex colours, or an `.npz` of `vertices` (V,3), `triangles` (T,3) and `uv` (T,3,2; v up) for a
texture. Colours and textures are 8-bit sRGB.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Literal

from pydantic import Field

from aug3d_core.run.stage import Frozen


class Emission(Frozen):
    """Surfaces emit their own colour: the photographed texture comes out unchanged, without shading."""

    kind: Literal["emission"] = "emission"


class Sunlit(Frozen):
    """Matt surfaces under a sun and an even sky, in relative strengths."""

    kind: Literal["sunlit"] = "sunlit"
    sun_azimuth_deg: float = Field(description="Direction to the sun, clockwise from north (+y).")
    sun_elevation_deg: float = Field(gt=0, le=90, description="Height of the sun above the horizon.")
    sun_colour: tuple[float, float, float] = (1.0, 0.94, 0.84)
    sun_strength: float = 4.0
    sky_colour: tuple[float, float, float] = (0.62, 0.76, 1.0)
    sky_strength: float = 0.39
    fill: float = Field(default=0.15, ge=0, description="Constant light on every surface, in place of later bounces.")

    @property
    def level_luminance(self) -> float:
        """Luminance of level white ground in the open: 1 leaves it as it was photographed."""
        sun = self.sun_strength * math.sin(math.radians(self.sun_elevation_deg)) / math.pi
        return sun * _luminance(self.sun_colour) + self.sky_strength * _luminance(self.sky_colour) + self.fill

    def exposed(self) -> Sunlit:
        """Return the same light, scaled so that open level ground is as bright as it was photographed."""
        by = 1 / self.level_luminance
        strengths = {name: getattr(self, name) * by for name in ("sun_strength", "sky_strength", "fill")}
        return self.model_copy(update=strengths)


def _luminance(rgb: tuple[float, float, float]) -> float:
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


class MeshFile(Frozen):
    """One mesh and, if it has texture coordinates, its texture."""

    path: Path
    texture: Path | None = None


class Shard(Frozen):
    """The views `first` to `last` (exclusive) of a camera file, written to `out` atomically."""

    first: int = Field(ge=0)
    last: int = Field(ge=1)
    out: Path
    samples: int = Field(ge=1)
    seed: int = 0


class RenderJob(Frozen):
    """Shards of views of the same meshes in the same light, rendered one after the other by one process."""

    meshes: tuple[MeshFile, ...]
    cameras: Path
    shards: tuple[Shard, ...]
    light: Emission | Sunlit = Field(default=Emission(), discriminator="kind")
    depth: bool = Field(default=True, description="Whether shards hold depth.")
    threads: int = Field(default_factory=lambda: len(os.sched_getaffinity(0)), ge=1)
    growth_mib: float = Field(
        default=150.0,
        ge=0,
        description="Memory growth after which the process ends, once the current shard is written [MiB].",
    )


class ViewDone(Frozen):
    """What a worker reports after each view."""

    cycles_s: float  # spent in Cycles' own tracing
    resident_mib: float  # memory of the process
