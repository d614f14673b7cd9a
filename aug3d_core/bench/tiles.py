"""The town's fusion and surface in one tile and in several, of the same depth maps: accuracy, borders, and memory."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aug3d_core.bench.borders import halvings, near_border
from aug3d_core.bench.figure import Figure, at_least, at_most, in_own_process, peak_mib
from aug3d_core.bench.fusion_tiles import fusion_figures
from aug3d_core.depth.files import BASELINE_FUSED
from aug3d_core.geometry.ground_tiles import Halved, Planned
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.stored_points import StoredPoints
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.sfm.files import TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import read_roles
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.join import rim_edges
from aug3d_core.surface.shape import Shape, edges
from aug3d_core.surface.tiles import plan_tiles
from aug3d_core.town.files import TRUTH_MESH

if TYPE_CHECKING:
    from aug3d_core.surface.build import Built

TILES = (1, 4, 16)
NEAR_GSD = 2.0  # from a border
FULL_PX = 100_000  # larger than any photograph
_SPREAD = 0.02  # by which a median of a sample misses the half
_FAR_PCT = 1.0  # of the flight's extent: what is further off counts as this far, or a few strays would be the mean
_HALF_PCT = 0.5


@dataclass(frozen=True)
class _Made:
    """Folders of what the surface is made of and measured by."""

    town: Path
    sfm: Path
    grouping: Path
    depth: Path
    config: SurfaceConfig

    def given(self, views: Views) -> tuple[np.ndarray, np.ndarray]:
        """Return the views that the mesh may use, and those that it is judged at."""
        roles = read_roles(self.grouping, len(views))
        return np.flatnonzero(np.isin(roles, ("train", "gap", "support"))), np.flatnonzero(roles == "target")


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Fuse the same maps, and draw and colour the same points, in 1, 4 and 16 tiles, each number in a process of its own."""
    trial = run_trial(store, "depth", scene, (), directly(store, say))
    if trial.failure:
        return {"town": Figure(None, "", None, None, trial.failure)}
    town, sfm, grouping, depth = (store.files_dir(trial.records[n]) for n in ("town", "sfm", "grouping", "depth"))
    made = _Made(town, sfm, grouping, depth, scene.config().surface)
    say("fusion", 0, 1, "in 1, 4 and 16 tiles")
    found = fusion_figures(town, sfm, depth, TILES)
    for number, tiles in enumerate(TILES):
        say("surface", number, len(TILES), "numbers of tiles")
        found |= in_own_process(partial(measured, made, tiles))
    for name in ("fscore_half_pct", "target_psnr"):
        one, most = (found[f"{name}_{tiles}"].value for tiles in (TILES[0], TILES[-1]))
        lost = None if one is None or most is None else one - most
        found[f"{name}_lost"] = at_most(*((0.01, lost, "share") if name.startswith("fscore") else (0.3, lost, "dB")))
    return found


def measured(made: _Made, tiles: int) -> dict[str, Figure]:
    """Return the figures of one number of tiles; memory is that of the process that draws, over what libraries take."""
    from aug3d_core.surface.build import build
    from aug3d_core.surface.clock import Clock
    from aug3d_core.surface.draw import draw

    fused, views = made.depth / BASELINE_FUSED, Views.load(made.sfm / VIEWS)
    given, targets = made.given(views)
    stored = StoredPoints.open(fused)
    count = len(stored)
    most = count if tiles == 1 else int(count / tiles * (1 + _SPREAD))
    before, start = peak_mib(), time.monotonic()
    drawn = draw(fused, views, given, made.config, Clock(), most=most, at_once=1)
    found = {
        "draw_seconds": Figure(time.monotonic() - start, "s"),
        "draw_mib": Figure(peak_mib() - before, "MiB"),
        "triangles": Figure(len(drawn.shape.triangles), "triangles"),
    }
    found |= _accuracy(made, drawn.shape, plan_tiles(stored, count // TILES[1]), drawn.ground_sampling)
    if tiles > 1:
        found["border_open_share"] = at_most(0.02, open_share(drawn.shape, plan_tiles(stored, most)), "share")
    ways = (made.sfm / VIEW_IMAGES, made.sfm / VIEW_MASKS)
    built = build(drawn, Tracks.load(made.sfm / TRACKS), views, given, *ways, made.config, Clock(), lambda: None)
    found["target_psnr"] = Figure(_psnr(made, built, views, given, targets), "dB")
    return {f"{name}_{tiles}": figure for name, figure in found.items()}


def _accuracy(made: _Made, shape: Shape, borders: Halved | Planned, gsd: float) -> dict[str, Figure]:
    """Return the F-score, and the mesh's mean distance from the truth near some borders over that elsewhere.

    The borders are those of four tiles whatever the mesh was made of: one tile tells what the ratio is without borders.
    """
    from aug3d_core.town.truth.mesh_errors import compare_meshes
    from aug3d_core.town.truth.pose_errors import extent_m, true_from_found
    from aug3d_core.town.truth.true_views import true_views

    found, truth = Views.load(made.sfm / VIEWS), true_views(made.town, made.sfm)
    moved, extent = true_from_found(found, truth), extent_m(truth)
    mesh = Mesh(moved.apply(shape.xyz), np.zeros((len(shape.xyz), 3), np.uint8), shape.triangles)
    eyes = truth.take(np.flatnonzero(~np.isin(truth.photo_id, found.photo_id[made.given(found)[1]])))
    errors = compare_meshes(mesh, Mesh.load(made.town / TRUTH_MESH), eyes, np.random.default_rng(0))
    off = np.minimum(errors.found_off_m, _FAR_PCT / 100 * extent)
    near = near_border(moved.inverse().apply(errors.found_xyz), borders, NEAR_GSD * gsd)
    ratio = float(off[near].mean() / off[~near].mean()) if near.any() else None
    return {
        "fscore_half_pct": at_least(0.8, errors.score(_HALF_PCT / 100 * extent).fscore, "share"),
        "border_error_ratio": Figure(ratio, "ratio"),
    }


def open_share(shape: Shape, plan: Halved | Planned) -> float:
    """Return the share of the length of a joined mesh's borders where only one side has an edge."""
    open_, all_, pairs = 0.0, 0.0, edges(shape)
    for border in halvings(plan):
        open_ += _length(shape, rim_edges(shape, border))
        all_ += _length(shape, pairs[(shape.xyz[pairs, border.axis] == border.at).all(axis=1)])
    return open_ / all_


def _length(shape: Shape, ends: np.ndarray) -> float:
    return float(np.linalg.norm(shape.xyz[ends[:, 0]] - shape.xyz[ends[:, 1]], axis=1).sum())


def _psnr(made: _Made, built: Built, views: Views, given: np.ndarray, targets: np.ndarray) -> float | None:
    from aug3d_core.surface import checks
    from aug3d_core.surface.stage import exposures

    renders = checks.render_views(built.best, views, [*targets], exposures(views, given, built.gains))
    ways = (made.sfm / VIEW_IMAGES, made.sfm / VIEW_MASKS)
    compared = checks.compare_views(*ways, views, [*targets], renders, FULL_PX)
    return checks.mean_finite([one.psnr for one in compared])
