"""Compare the reconstructed mesh with the true town, and its renders with the photographs that it never saw.

The mesh is `baseline_mesh.ply`, made of all photographs but the test's targets; it is moved to the true frame by the
similarity that best maps its cameras' centres to the true ones. Distances are told in % of the flight's extent, the diagonal
of the box about its camera centres. Renders are compared at full size, over the pixels that the mesh covers.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress
from aug3d_core.sfm.files import VIEW_IMAGES, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import BASELINE_MESH, BASELINE_RENDERS
from aug3d_core.town.config import MeshTruthConfig
from aug3d_core.town.files import TRUTH_MESH
from aug3d_core.town.truth.error_map import draw_error_map
from aug3d_core.town.truth.mesh_errors import MeshErrors, compare_meshes
from aug3d_core.town.truth.pose_errors import FEWEST, extent_m, true_from_found
from aug3d_core.town.truth.true_views import true_views

_MAP = "mesh_errors.png"
_COVERED = 250  # alpha from which a pixel counts as covered
_DISTANCES = {"half_pct": 0.5, "one_pct": 1.0}  # of the extent
_SEED = 0


def run(inputs: Inputs, config: MeshTruthConfig, out: Path, progress: Progress) -> Outcome:
    """Measure accuracy, completeness and F-score at 0.5 and 1 % of extent, and PSNR at the targets' poses."""
    found, truth = Views.load(inputs["sfm"] / VIEWS), true_views(inputs["town"], inputs["sfm"])
    targets = _targets(inputs["grouping"])
    metrics: dict[str, Metric] = dict(compare_renders(inputs["sfm"], inputs["surface"], targets))
    if len(found) < FEWEST:
        note = f"only {len(found)} photographs have a pose: the mesh cannot be laid over the truth"
        return Outcome(metrics=metrics, state="degraded", notes=(note,))
    progress(0, 2, "measuring the mesh")
    true_mesh = Mesh.load(inputs["town"] / TRUTH_MESH)
    mesh = Mesh.load(inputs["surface"] / BASELINE_MESH)
    mesh = replace(mesh, xyz=true_from_found(found, truth).apply(mesh.xyz.astype(float)))
    given = truth.take(np.flatnonzero(~np.isin(truth.photo_id, targets)))
    errors = compare_meshes(mesh, true_mesh, given, np.random.default_rng(_SEED))
    extent = extent_m(truth)
    metrics |= _figures(errors, extent)
    progress(1, 2, "drawing the errors")
    draw_error_map(errors, true_mesh, mesh, extent, out / _MAP)
    notes = () if len(errors.found_off_m) else ("no part of the mesh lies where the photographs look",)
    return Outcome(
        metrics=metrics,
        state="degraded" if notes else "ok",
        notes=notes,
        pictures={"The true town, the mesh, and how far each is from the other": _MAP},
    )


def compare_renders(sfm: Path, surface: Path, photo_ids: list[int]) -> dict[str, Metric]:
    """Return the mean over photographs of the PSNR (dB) over covered pixels, and of the covered share; None without any."""
    psnr, covered = [], []
    for photo_id in photo_ids:
        with Image.open(sfm / VIEW_IMAGES / image_name(photo_id)) as image:
            photo = np.asarray(image.convert("RGB"), float) / 255
        with Image.open(surface / BASELINE_RENDERS / image_name(photo_id)) as image:
            render = np.asarray(image.convert("RGBA"), float) / 255
        inside = render[..., 3] >= _COVERED / 255
        covered.append(float(inside.mean()))
        if inside.any():
            error = np.mean((photo[inside] - render[inside][:, :3]) ** 2)
            psnr.append(float(-10 * np.log10(max(error, 1e-10))))
    return {
        "mesh_render_psnr": float(np.mean(psnr)) if psnr else None,
        "mesh_render_covered": float(np.mean(covered)) if covered else None,
    }


def _targets(grouping: Path) -> list[int]:
    table = pd.read_parquet(grouping / SPLIT_TABLE)
    return table.loc[table["role"].astype(str) == "target", "photo_id"].astype(int).tolist()


def _figures(errors: MeshErrors, extent: float) -> dict[str, Metric]:
    figures: dict[str, Metric] = {"extent_m": extent}
    for name, pct in _DISTANCES.items():
        score = errors.score(pct / 100 * extent)
        figures |= {
            f"accuracy_{name}": score.accuracy,
            f"completeness_{name}": score.completeness,
            f"fscore_{name}": score.fscore,
        }
    if len(errors.found_off_m):
        figures["accuracy_median_m"] = float(np.median(errors.found_off_m))
        figures["completeness_median_m"] = float(np.median(errors.true_off_m))
    return figures
