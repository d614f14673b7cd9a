"""Views per second of Cycles against samples, resolution and triangles, as a chart."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.rendering.given import find_mesh
from aug3d_core.rendering.job import MeshFile, RenderJob, Shard
from aug3d_core.rendering.launch import render
from aug3d_core.studies.common.trial import Say
from aug3d_core.surface.files import MESH_TEXTURE, TEXTURED_MESH

_VIEWS = 21  # of each value; the first is not counted, since it builds the tree
_SAMPLES = (1, 2, 4, 8, 16, 32, 64)
_WIDTHS = (64, 128, 256, 512)
_FINER = (0, 1, 2)  # times that every triangle is cut in four


@dataclass(frozen=True)
class Speed:
    """Views per second of one worker on one thread, each view with its depth, once the mesh is loaded."""

    setting: str
    value: float
    default: bool
    views_per_second: float


def speeds(surface: Path, cameras: dict[str, np.ndarray], samples: int, scratch: Path, say: Say) -> list[Speed]:
    """Return a speed for every value of every setting, the others at what the stage chooses."""
    few = {name: array[:_VIEWS] for name, array in cameras.items()}
    width = int(cameras["size"][0, 0])
    counts, widths = sorted({*_SAMPLES, samples}), sorted({*_WIDTHS, width})
    variants = [(few, count) for count in counts] + [(resized(few, pixels), samples) for pixels in widths]
    named = [("samples per pixel", count, count == samples) for count in counts]
    named += [("width of a view (px)", pixels, pixels == width) for pixels in widths]
    measured = _measure(find_mesh(surface), variants, scratch, say)
    for times in _FINER:
        finer, triangles = _finer(surface, times, scratch)
        named.append(("triangles", triangles, times == 0))
        measured += _measure(finer, [(few, samples)], scratch, say)
    return [Speed(*name, speed) for name, speed in zip(named, measured, strict=True)]


def many_views(cameras: dict[str, np.ndarray], count: int, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """Return `count` views of a size: the planned ones again and again, each time rolled about where they look.

    So no view is the same as another, and each shows as much surface as the plan wants.
    """
    row = np.arange(count) % len(cameras["view_id"])
    angle = 2 * np.pi * (np.arange(count) // len(cameras["view_id"])) * (np.sqrt(5) - 1) / 2
    roll = np.tile(np.eye(4), (count, 1, 1))
    roll[:, 0, 0] = roll[:, 1, 1] = np.cos(angle)
    roll[:, 1, 0] = np.sin(angle)
    roll[:, 0, 1] = -roll[:, 1, 0]
    ratio = size[0] / cameras["size"][row, :1]
    middle = [size[0] / 2, size[1] / 2]
    return {
        "view_id": np.arange(count),
        "dome_id": np.zeros(count, int),
        "world_from_cam": cameras["world_from_cam"][row] @ roll,
        "intrinsics": np.column_stack([cameras["intrinsics"][row, :2] * ratio, np.tile(middle, (count, 1))]),
        "size": np.tile(size, (count, 1)),
    }


def _measure(
    mesh: MeshFile, variants: Sequence[tuple[dict[str, np.ndarray], int]], scratch: Path, say: Say
) -> list[float]:
    """Return the views per second of each variant (cameras, samples), one after the other in one worker."""
    together = {name: np.concatenate([cameras[name] for cameras, _ in variants]) for name in variants[0][0]}
    np.savez(scratch / "speed_cameras.npz", **together)  # type: ignore[arg-type]
    shards = []
    for number, (_, samples) in enumerate(variants):
        out = scratch / f"speed_{number}.npz"
        out.unlink(missing_ok=True)
        shards.append(Shard(first=number * _VIEWS, last=(number + 1) * _VIEWS, out=out, samples=samples))
    job = RenderJob(meshes=(mesh,), cameras=scratch / "speed_cameras.npz", shards=tuple(shards), threads=1)
    ends: list[float] = []

    def tick(done: int) -> None:
        ends.append(time.monotonic())
        say("rendering speed", done, len(together["view_id"]), "views")

    render(job, tick)
    runs = np.reshape(ends, (len(variants), _VIEWS))
    return ((_VIEWS - 1) / (runs[:, -1] - runs[:, 0])).tolist()


def resized(cameras: dict[str, np.ndarray], width_px: int) -> dict[str, np.ndarray]:
    """Return the same views with more or fewer pixels."""
    ratio = width_px / cameras["size"][:, :1]
    size = np.rint(cameras["size"] * ratio).astype(int)
    return cameras | {"size": size, "intrinsics": cameras["intrinsics"] * ratio}


def _finer(surface: Path, times: int, scratch: Path) -> tuple[MeshFile, int]:
    mesh = TexturedMesh.load(surface / TEXTURED_MESH, surface / MESH_TEXTURE)
    for _ in range(times):
        mesh = quartered(mesh)
    file = MeshFile(path=scratch / "finer.npz", texture=scratch / "finer.png")
    mesh.save(file.path, scratch / "finer.png")
    return file, len(mesh.triangles)


def quartered(mesh: TexturedMesh) -> TexturedMesh:
    """Cut every triangle in four at the middles of its sides: the same picture from more triangles."""
    corners = mesh.xyz[mesh.triangles]
    xyz, uv = _quarters(corners).reshape(-1, 3), _quarters(mesh.uv)
    triangles: Int[np.ndarray, "t 3"] = np.arange(len(xyz)).reshape(-1, 3)
    return TexturedMesh(xyz, triangles, uv.reshape(-1, 3, 2), mesh.texture)


def _quarters(corners: Float[np.ndarray, "t 3 d"]) -> Float[np.ndarray, "t 4 3 d"]:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1)


def draw_speeds(points: Sequence[Speed], path: Path) -> None:
    """Write one panel per setting as PNG; the stage's own value in orange."""
    settings = list(dict.fromkeys(point.setting for point in points))
    figure = Figure(figsize=(5.2 * len(settings), 3.9), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("Cycles on the town's mesh, one thread: views per second", fontsize=11)
    for index, setting in enumerate(settings):
        axes = figure.add_subplot(1, len(settings), index + 1)
        axes.set(xlabel=setting, ylabel="views per second", xscale="log", yscale="log")
        chosen = sorted((point for point in points if point.setting == setting), key=lambda point: point.value)
        axes.plot([p.value for p in chosen], [p.views_per_second for p in chosen], color="#94a3b8", zorder=1)
        for p in chosen:
            axes.scatter(p.value, p.views_per_second, s=46, color="#c2410c" if p.default else "#1d4ed8", zorder=2)
            axes.annotate(
                f"{p.views_per_second:.3g}", (p.value, p.views_per_second), (5, 5), textcoords="offset points", size=7
            )
        axes.set_xticks([p.value for p in chosen], [f"{p.value:,.0f}" for p in chosen])
        axes.set_ylim(min(p.views_per_second for p in chosen) / 2, max(p.views_per_second for p in chosen) * 2)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        axes.xaxis.minorticks_off()
        axes.grid(True, which="both", alpha=0.2)
        axes.margins(x=0.2)
    figure.savefig(path, dpi=110, metadata={"Software": None})
