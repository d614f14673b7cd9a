"""The map of the town that `aug3d export --format map` draws, against the same map of its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from skimage.registration import phase_cross_correlation

from aug3d_core.bench.figure import Figure, at_most
from aug3d_core.export.maps import NO_HEIGHT, Grid, grid_over, strips
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import VIEWS
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.surface.files import BASELINE_MESH_TEXTURE, BASELINE_TEXTURED_MESH
from aug3d_core.town.files import TRUTH_MESH
from aug3d_core.town.truth.true_views import true_views

_TILE_PX, _FULL = 96, 0.999  # of tiles that are compared, and how much of one must be known in both
_LEAST_CONTRAST = 8.0  # standard deviation of grey values, of which 255 is white
_PARTS = 20  # of a pixel


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Return by how much tiles of the orthophoto are shifted, and heights are off.

    The truth is moved to the scene's world first: by how much GPS puts that wrong is not the map's.
    """
    trial = run_trial(store, "surface", scene, (), directly(store, say))
    if trial.failure:
        return {"town_orthophoto": Figure(None, "", None, None, trial.failure)}
    town, sfm, surface = (store.files_dir(trial.records[name]) for name in ("town", "sfm", "surface"))
    views, truth_of = Views.load(sfm / VIEWS), true_views(town, sfm)
    same = truth_of.take(np.searchsorted(truth_of.photo_id, views.photo_id))
    moved = fit_similarity(centres(same.cam_from_world), centres(views.cam_from_world))
    truth = Mesh.load(town / TRUTH_MESH)
    truth = replace(truth, xyz=moved.apply(truth.xyz))
    ours = TexturedMesh.load(surface / BASELINE_TEXTURED_MESH, surface / BASELINE_MESH_TEXTURE)
    grid = grid_over(ours, views, None)
    (grey, heights), (true_grey, true_heights) = _seen(ours, grid), _seen(truth, grid)
    known = (heights != NO_HEIGHT) & (true_heights != NO_HEIGHT)
    shifts = [*_shifts(grey, true_grey, known)]
    return {
        "town_orthophoto_shift_px": at_most(1.0, float(np.median(shifts)) if shifts else None, "px"),
        "town_surface_model_off": Figure(float(np.median(np.abs(heights - true_heights)[known])), "m"),
        "town_orthophoto_pixel": Figure(grid.pixels.a, "m"),
    }


def _seen(mesh: TexturedMesh | Mesh, grid: Grid) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """Return the grey values and the heights of a whole map."""
    drawn = [(rgba[..., :3].mean(axis=-1), heights) for _, rgba, heights in strips(mesh, grid, None)]
    grey, heights = (np.concatenate(one) for one in zip(*drawn, strict=True))
    return grey, heights.astype(float)


def _shifts(
    ours: Float[np.ndarray, "h w"], truth: Float[np.ndarray, "h w"], known: Bool[np.ndarray, "h w"]
) -> Iterator[float]:
    """Yield by how many pixels each tile with something on it is shifted (phase correlation: Guizar-Sicairos 2008)."""
    for top in range(0, len(ours) - _TILE_PX, _TILE_PX):
        for left in range(0, ours.shape[1] - _TILE_PX, _TILE_PX):
            tile = np.s_[top : top + _TILE_PX, left : left + _TILE_PX]
            if known[tile].mean() >= _FULL and truth[tile].std() >= _LEAST_CONTRAST:
                pair = (one[tile] - one[tile].mean() for one in (truth, ours))
                yield float(np.hypot(*phase_cross_correlation(*pair, upsample_factor=_PARTS)[0]))
