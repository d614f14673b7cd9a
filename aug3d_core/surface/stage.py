"""The surface stage: the mesh that domes are rendered from, and the mesh that stands for geometry alone at test time.

`mesh.ply` comes from train photos only, so that no pixel of a test photo can reach a rendered view. `baseline_mesh.ply`
may use every photo but the targets, because at test time the support photos are given; its renders at the targets'
poses are one of the cheap answers that the model is measured against.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout
from aug3d_core.surface import checks
from aug3d_core.surface.build import Built, build
from aug3d_core.surface.config import SurfaceConfig

FEW_POINTS = 1000
LOW_COVERAGE = 0.5
PICTURE_ROWS = 3


def run(inputs: Inputs, config: SurfaceConfig, out: Path, progress: Progress) -> Outcome:
    """Build both meshes, render the second at the targets, and compare it with the photos."""
    sfm = inputs["sfm"]
    views, images = Views.load(sfm / layout.VIEWS), sfm / layout.VIEW_IMAGES
    role = _roles(inputs["grouping"], len(views))
    train, given = role == "train", role != "target"
    total, done = int(train.sum() + given.sum()) + 2, 0

    def tick() -> None:
        nonlocal done
        done += 1
        progress(done, total, "colouring the mesh")

    points, tracks = Points.load(sfm / layout.POINTS), Tracks.load(sfm / layout.TRACKS)
    train_mesh = build(points, tracks, views, train, images, config, tick)
    train_mesh.mesh.save(out / layout.MESH)
    baseline = build(points, tracks, views, given, images, config, tick)
    baseline.mesh.save(out / layout.BASELINE_MESH)
    progress(total - 2, total, "rendering the mesh at the test poses")
    targets = np.flatnonzero(role == "target").tolist()
    renders = _save_renders(out / layout.BASELINE_RENDERS, baseline, views, targets)
    progress(total - 1, total, "comparing the mesh with the photos")
    figures = _figures(train_mesh, baseline) | _compare(images, views, role, baseline, targets, renders, config)
    pictures = _draw(out, images, views, targets, renders, train_mesh, baseline)
    progress(total, total, "done")
    notes = _notes(figures)
    return Outcome(metrics=figures, state="degraded" if notes else "ok", notes=notes, pictures=pictures)


def _roles(grouping: Path, count: int) -> np.ndarray:
    """Return the role of each view."""
    table = pd.read_parquet(grouping / layout.SPLIT_TABLE)
    role = np.full(count, "", dtype=object)
    role[table["view"].to_numpy()] = table["role"].astype(str).to_numpy()
    return role


def _save_renders(folder: Path, baseline: Built, views: Views, targets: list[int]) -> list[Image.Image]:
    folder.mkdir(exist_ok=True)
    renders = checks.render_views(baseline.mesh, views, targets)
    for view, render in zip(targets, renders, strict=True):
        render.save(folder / layout.image_name(views.photo_id[view]))
    return renders


def _figures(train: Built, baseline: Built) -> dict:
    """Return the sizes of the meshes; spacings in photo pixels, so that they mean the same in every unit."""
    return {
        "points": train.points,
        "vertices": len(train.mesh.xyz),
        "triangles": len(train.mesh.triangles),
        "octree_depth": train.octree_depth,
        "point_spacing_px": round(train.point_spacing / train.ground_sampling, 3),
        "vertex_spacing_px": round(train.vertex_spacing / train.ground_sampling, 3),
        "guessed_share": round(train.guessed_share, 4),
        "baseline_points": baseline.points,
        "baseline_vertices": len(baseline.mesh.xyz),
        "baseline_triangles": len(baseline.mesh.triangles),
    }


def _compare(
    images: Path,
    views: Views,
    role: np.ndarray,
    baseline: Built,
    targets: list[int],
    renders: list[Image.Image],
    config: SurfaceConfig,
) -> dict:
    """Return PSNR and coverage at photos that coloured the mesh, and at the targets, which did not."""
    given = np.flatnonzero(role != "target")
    known = given[np.linspace(0, len(given) - 1, min(len(given), config.check_views)).round().astype(int)].tolist()
    at_known = checks.compare_views(
        images, views, known, checks.render_views(baseline.mesh, views, known), config.check_px
    )
    at_targets = checks.compare_views(images, views, targets, renders, config.check_px)
    return {
        "render_psnr": checks.mean_finite([c.psnr for c in at_known]),
        "covered_share": checks.mean_finite([c.covered_share for c in at_known]),
        "target_render_psnr": checks.mean_finite([c.psnr for c in at_targets]),
        "target_covered_share": checks.mean_finite([c.covered_share for c in at_targets]),
    }


def _draw(
    out: Path,
    images: Path,
    views: Views,
    targets: list[int],
    renders: list[Image.Image],
    train: Built,
    baseline: Built,
) -> dict[str, str]:
    """Write the pictures and return them by caption."""
    pictures = {"The mesh made of train photos, from above: colours and shape": "top_view.png"}
    checks.top_view(train.mesh).save(out / "top_view.png")
    if targets:
        rows = np.linspace(0, len(targets) - 1, min(len(targets), PICTURE_ROWS)).round().astype(int)
        sheet = checks.side_by_side(images, views, [targets[r] for r in rows], [renders[r] for r in rows], 480)
        sheet.save(out / "photo_and_mesh.png")
        pictures["Held-out photos (left) beside the mesh made without them (right)"] = "photo_and_mesh.png"
    return pictures


def _notes(figures: dict) -> tuple[str, ...]:
    notes = []
    if figures["points"] < FEW_POINTS:
        notes.append(f"only {figures['points']} good points carry the surface: its shape is coarse")
    if (figures["covered_share"] or 0.0) < LOW_COVERAGE:
        notes.append(f"the mesh covers only {100 * (figures['covered_share'] or 0.0):.0f} % of the photos")
    return tuple(notes)
