"""Pictures of a town from given cameras, as Blender renders them: before lens and sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float16, UInt8
from PIL import Image

from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.geometry.views import Views
from aug3d_core.rendering.files import shard_name
from aug3d_core.rendering.job import MeshFile, RenderJob, Shard, Sunlit
from aug3d_core.rendering.launch import render
from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.model import TexturedMesh
from aug3d_core.town.generator.town import Town


@dataclass(frozen=True)
class Studio:
    """A town and cameras as files that a render process reads. depth: whether that of the pictures is wanted too."""

    meshes: tuple[MeshFile, ...]
    cameras: Path
    config: TownConfig
    depth: bool

    @classmethod
    def of(cls, town: Town, views: Views, config: TownConfig, folder: Path, depth: bool = False) -> Studio:
        """Write the files into a folder."""
        meshes = (
            _export(town.ground, town.ground_image, folder / "ground"),
            _export(town.things, town.things_image, folder / "things"),
        )
        np.savez(
            folder / "cameras.npz",
            view_id=views.photo_id,
            world_from_cam=homogeneous(invert(views.cam_from_world)),
            intrinsics=views.intrinsics,
            size=views.size,
        )
        return cls(meshes, folder / "cameras.npz", config, depth)

    def shoot(
        self, first: int, last: int, on_view: Callable[[int], None]
    ) -> tuple[UInt8[np.ndarray, "n h w 3"], UInt8[np.ndarray, "n h w"], Float16[np.ndarray, "n h w"] | None]:
        """Return colour, alpha and depth of the cameras from `first` up to `last`; `on_view(done)` is called after each."""
        out = self.cameras.with_name(shard_name(first))
        shard = Shard(first=first, last=last, out=out, samples=self.config.samples, seed=self.config.seed)
        light = Sunlit(sun_azimuth_deg=self.config.sun_azimuth_deg, sun_elevation_deg=self.config.sun_elevation_deg)
        render(
            RenderJob(meshes=self.meshes, cameras=self.cameras, shards=(shard,), light=light, depth=self.depth), on_view
        )
        with np.load(out) as arrays:
            shot = arrays["rgb"], arrays["alpha"], arrays["depth"] if self.depth else None
        out.unlink()  # else the disk would hold the whole flight's
        return shot


def _export(mesh: TexturedMesh, image: UInt8[np.ndarray, "h w 3"], stem: Path) -> MeshFile:
    file, texture = stem.with_suffix(".npz"), stem.with_suffix(".bmp")
    np.savez(file, vertices=mesh.vertices, triangles=mesh.triangles, uv=mesh.uv)
    Image.fromarray(image).save(texture)
    return MeshFile(path=file, texture=texture)
