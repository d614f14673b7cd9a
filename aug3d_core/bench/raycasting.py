"""Ray casting as the speed limit of rendering: the same views without Cycles, and how near they come to it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from aug3d_core.bench.figure import Figure
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import invert
from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear
from aug3d_core.studies.common.trial import Say
from aug3d_core.surface.files import MESH_TEXTURE, TEXTURED_MESH

_VIEWS = 100  # of those that Cycles rendered, spread over them
_SUBPIXELS = 3  # a side: about as many rays per pixel as rendering takes samples


def raycast_figures(surface: Path, cameras: dict[str, np.ndarray], shards: Path, say: Say) -> dict[str, Figure]:
    """Return the speed of ray casting, with one ray per pixel and with nine, and its PSNR to Cycles where both see surface."""
    found = {}
    mesh = TexturedMesh.load(surface / TEXTURED_MESH, surface / MESH_TEXTURE)
    caster = Raycaster(mesh.xyz, mesh.triangles)
    rgb, alpha = _rendered(shards)
    chosen = np.linspace(0, len(rgb) - 1, min(len(rgb), _VIEWS)).astype(int)
    for key, side in (("", 1), ("_nine_rays", _SUBPIXELS)):
        start, casts = time.monotonic(), []
        for done, view in enumerate(chosen):
            say("ray casting", done, len(chosen), "views")
            casts.append(cast_view(caster, mesh, {name: array[view] for name, array in cameras.items()}, side))
        found[f"raycast{key}_views_per_minute"] = Figure(60 * len(chosen) / (time.monotonic() - start), "1/min")
        both = (alpha[chosen] == 255) & np.stack([cast.covered == 1 for cast in casts])
        off = np.stack([cast.rgb for cast in casts])[both].astype(float) - rgb[chosen][both]
        found[f"rendering_raycast{key}_psnr_db"] = Figure(float(10 * np.log10(255**2 / (off**2).mean())), "dB")
    return found


def _rendered(shards: Path) -> tuple[UInt8[np.ndarray, "n h w 3"], UInt8[np.ndarray, "n h w"]]:
    rgb, alpha = [], []
    for path in sorted(shards.glob("*.npz")):
        with np.load(path, allow_pickle=False) as arrays:
            rgb.append(arrays["rgb"])
            alpha.append(arrays["alpha"])
    return np.concatenate(rgb), np.concatenate(alpha)


@dataclass(frozen=True)
class Cast:
    """A view by ray casting."""

    rgb: UInt8[np.ndarray, "h w 3"]
    covered: Float[np.ndarray, "h w"]


def cast_view(caster: Raycaster, mesh: TexturedMesh, camera: dict[str, np.ndarray], side: int) -> Cast:
    """Cast `side` x `side` rays through each pixel of a view and average their light."""
    fine = camera["intrinsics"] * side
    render = caster.render(mesh, invert(camera["world_from_cam"][:3]), fine, camera["size"] * side)
    if side == 1:
        return Cast(render.rgb, render.alpha / 255.0)
    seen = _blocks(render.alpha[..., None] / 255.0, side)
    light = _blocks(linear_from_srgb(render.rgb) * (render.alpha[..., None] / 255.0), side)
    return Cast(srgb_from_linear(light / np.maximum(seen, 1e-6)), seen[..., 0])


def _blocks(image: Float[np.ndarray, "h w c"], side: int) -> Float[np.ndarray, "H W c"]:
    height, width, channels = image.shape
    return image.reshape(height // side, side, width // side, side, channels).mean(axis=(1, 3))
