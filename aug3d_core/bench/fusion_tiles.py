"""The town's depth maps fused in one tile and in several: memory, time, accuracy, and borders."""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from aug3d_core.bench.borders import near_border
from aug3d_core.bench.cloud import off_truth
from aug3d_core.bench.figure import Figure, at_most, in_own_process, peak_mib
from aug3d_core.depth.files import (
    BASELINE_FUSED,
    DENSE_WORKSPACE,
    WORKSPACE_DEPTH_MAPS,
    WORKSPACE_NORMAL_MAPS,
    geometric_map_name,
)
from aug3d_core.geometry.depth_maps import read_map
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import Halved, Planned
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS

if TYPE_CHECKING:
    from aug3d_core.depth.fusion_tiles import Dense

NEAR_PX = 1.0  # pixels of a depth map on the ground, from a border
CLOSE_PX = 0.25  # points that are nearer to one another may be one that was made twice
_SPREAD = 0.02  # by which a median of a sample misses the half


def fusion_figures(town: Path, sfm: Path, depth: Path, numbers: tuple[int, ...]) -> dict[str, Figure]:
    """Fuse all maps that a depth stage has made in so many tiles each, each time in a process of its own."""
    found: dict[str, Figure] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        in_own_process(partial(_lay_out, sfm, depth, folder))
        for tiles in numbers:
            made, plan, pixel = in_own_process(partial(_fuse, sfm, depth, folder, tiles))
            made |= in_own_process(partial(_judge, town, sfm, depth, folder, plan, pixel))
            found |= {f"fusion_{figure}_{tiles}": value for figure, value in made.items()}
    return found


def _dense(sfm: Path, depth: Path, workspace: Path) -> tuple[Dense, list[int]]:
    """Return what is fused, and the views that have a map."""
    from aug3d_core.depth.fusion_tiles import Dense

    views = Views.load(sfm / VIEWS)
    sizes = views.size.copy()
    maps = [depth / DENSE_WORKSPACE / WORKSPACE_DEPTH_MAPS / geometric_map_name(int(one)) for one in views.photo_id]
    chosen = [view for view, file in enumerate(maps) if file.exists()]
    for view in chosen:
        sizes[view] = read_map(maps[view]).shape[::-1]
    return Dense(workspace, views, sizes, Points.load(sfm / POINTS), Tracks.load(sfm / TRACKS)), chosen


def _lay_out(sfm: Path, depth: Path, folder: Path) -> None:
    """Make again of the workspace what the stage drops, and link the maps."""
    from aug3d_core.depth.workspace import write_workspace

    dense, chosen = _dense(sfm, depth, folder / DENSE_WORKSPACE)
    sparse = (dense.points, dense.tracks)
    write_workspace(dense.workspace, dense.views, dense.sizes, *sparse, sfm / VIEW_IMAGES, sfm / VIEW_MASKS, chosen)
    for kind in (WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS):
        for view in chosen:
            link = dense.map_path(kind, view)
            link.symlink_to(depth.resolve() / DENSE_WORKSPACE / kind / link.name)


def _fuse(
    sfm: Path, depth: Path, folder: Path, tiles: int
) -> tuple[
    dict[str, Figure],  # memory is over that of libraries, cameras and sparse points
    Halved | Planned,
    float,  # a map's pixel on the ground, world units
]:
    """Fuse into the folder."""
    from aug3d_core.depth.fusion_tiles import fuse_to, plan_fusion

    dense, chosen = _dense(sfm, depth, folder / DENSE_WORKSPACE)
    filled = sum(int((read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view)) > 0).sum()) for view in chosen)
    most = int(dense.sizes[chosen].prod(axis=1).sum()) if tiles == 1 else int(filled / tiles * (1 + _SPREAD))
    before, start = peak_mib(), time.monotonic()
    fused = folder / str(tiles) / BASELINE_FUSED
    fused.parent.mkdir()
    _, made = fuse_to(fused, dense, chosen, most=most)
    figures = {
        "tiles": Figure(made, "tiles"),
        "seconds": Figure(time.monotonic() - start, "s"),
        "mib": Figure(peak_mib() - before, "MiB"),
    }
    fused.replace(folder / BASELINE_FUSED)
    view = chosen[0]
    depths = read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view))
    pixel = float(np.median(depths[depths > 0]) / dense.camera(view).intrinsics[0])
    return figures, plan_fusion(dense, chosen, most).tiles, pixel


def _judge(town: Path, sfm: Path, depth: Path, folder: Path, plan: Halved | Planned, pixel: float) -> dict[str, Figure]:
    """Compare the points in the folder with the truth, and near borders with those that the stage made."""
    off = off_truth(town, sfm, folder)
    figures = {"points": off["town_points"], "off": off["town_points_off"], "far_share": off["town_points_far_share"]}
    if isinstance(plan, Halved):
        tiled, whole = (Fused.load(at / BASELINE_FUSED).xyz.astype(np.float64) for at in (folder, depth))
        near = [near_border(xyz, plan, NEAR_PX * pixel) for xyz in (tiled, whole)]
        density = (near[0].sum() / len(tiled)) / (near[1].sum() / len(whole))
        close = [
            float((KDTree(xyz).query(xyz[rows], 2)[0][:, 1] < CLOSE_PX * pixel).mean())
            for xyz, rows in zip((tiled, whole), near, strict=True)
        ]
        figures |= {
            "border_density_off": at_most(0.05, float(abs(density - 1)), ""),
            "border_points": Figure(int(near[0].sum()), "points"),
            "border_close_more": at_most(0.02, close[0] - close[1], "share"),
        }
    return figures
