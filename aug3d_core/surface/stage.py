"""The surface stage: the mesh that domes are rendered from, and the mesh that stands for geometry alone at test time.

`mesh.ply` comes from train photos only, so that no pixel of a test photo can reach a rendered view. `baseline_mesh.ply`
may use every photo but the targets, because at test time the support photos are given; its renders at the targets'
poses are one of the cheap answers that the model is measured against. Either is written again with a texture if colours
live in one. `mesh_sources.json` names the photos that each was made of, for the leak audit.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from PIL import Image
from scipy.spatial import KDTree

from aug3d_core.geometry.spread import evenly_spread
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress
from aug3d_core.surface import checks
from aug3d_core.surface.build import Built
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.decisions import decisions
from aug3d_core.surface.files import BASELINE_RENDERS, MESH_SOURCES, PIECES
from aug3d_core.surface.meshes import GIVEN, TRAIN, Scene, both

FEW_POINTS = 10_000
LOW_COVERAGE = 0.5
UNEVEN = 1.5  # brightest photo's exposure over the darkest one's, from which people should know
NEIGHBOURS = 3  # given photos that tell how a target was exposed
PICTURE_ROWS = 3
PICTURE_PX = 480
FULL_PX = 100_000  # larger than any photo


def run(inputs: Inputs, config: SurfaceConfig, out: Path, progress: Progress) -> Outcome:
    """Build both meshes, render the second at the targets, and compare it with the photos."""
    scene, clock = Scene.load(inputs, config), Clock()
    views, targets = scene.views, scene.having("target")
    train, given = (scene.having(*wanted.roles) for wanted in (TRAIN, GIVEN))
    train_mesh, baseline = both(scene, inputs["depth"], out, clock, progress)
    sources = {"mesh": views.photo_id[train].tolist(), "baseline": views.photo_id[given].tolist()}
    (out / MESH_SOURCES).write_text(json.dumps(sources))
    known = evenly_spread(given, config.check_views)
    with clock.step("checks"):
        reasons = _reasons(baseline, config)
        figures = _figures(train_mesh, baseline) | {"needs": "; ".join(reasons.values())}
        compared, shown = _compare(scene, targets, known, baseline, exposures(views, given, baseline.gains), out)
        figures |= compared
        pictures = _draw(out, scene, targets, known, shown, train_mesh, baseline)
    figures |= {f"{name.replace(' ', '_')}_seconds": round(spent, 1) for name, spent in clock.seconds.items()}
    shutil.rmtree(out / PIECES)
    progress(1, 1, "done")
    doubts = _doubts(figures)
    return Outcome(
        metrics=figures,
        state="degraded" if doubts else "ok",
        notes=(*doubts, *_remarks(figures)),
        pictures=pictures,
        decisions=tuple(decisions(figures, reasons)),
    )


def exposures(views: Views, given: Int[np.ndarray, " m"], gains: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "n 3"]:
    """Return the factors that even out each view; a target's is taken from the given photos nearest to it."""
    at = centres(views.cam_from_world)
    nearest = KDTree(at[given]).query(at, k=min(NEIGHBOURS, len(given)))[1].reshape(len(views), -1)
    exposures = np.exp(np.log(gains)[nearest].mean(axis=1))
    exposures[given] = gains
    return exposures


def _figures(train: Built, baseline: Built) -> dict[str, Metric]:
    """Return the sizes of the meshes; lengths in GSD, so that they mean the same in every unit."""
    figures: dict[str, Metric] = {}
    for prefix, built in (("", train), ("baseline_", baseline)):
        gsd = built.ground_sampling
        figures |= {
            f"{prefix}points": built.points,
            f"{prefix}tiles": built.tiles,
            f"{prefix}point_spacing_gsd": round(built.point_spacing / gsd, 3),
            f"{prefix}octree_depth": built.octree_depth,
            f"{prefix}vertices": len(built.mesh.xyz),
            f"{prefix}triangles": len(built.mesh.triangles),
            f"{prefix}triangles_full": built.triangles_full,
            f"{prefix}decimation_error_gsd": round(built.decimation_error / gsd, 3),
            f"{prefix}bridged_share": round(built.bridged_share, 4),
            f"{prefix}colour_detail_gsd": round(built.detail / gsd, 3),
            f"{prefix}texels": 0 if built.textured is None else built.textured.texture[..., 0].size,
            f"{prefix}charts": built.charts,
            f"{prefix}exposure_spread": round(float(np.max(built.gains.max(axis=0) / built.gains.min(axis=0))), 3),
        }
    return figures


def _reasons(built: Built, config: SurfaceConfig) -> dict[str, str]:
    """Say why the mesh has this depth of octree, and this many triangles and texels."""
    gsd = built.ground_sampling
    detail = "a texel" if config.colour == "texture" else "between vertices that carry colour"
    asked = config.texel_gsd if config.colour == "texture" else 1.0
    why = "as asked" if built.detail <= 1.001 * asked * gsd else "all that the budget allows"
    return {
        "octree_depth": f"octree of depth {built.octree_depth}: cells of two points' spacings, finer would model their noise",
        "triangles": f"{len(built.mesh.triangles)} of {built.triangles_full} triangles: half as many would move 5 % of the"
        f" surface by more than {config.max_error_gsd:g} GSD",
        "texels": f"{built.detail / gsd:.2f} GSD {detail}: {why}",
    }


def _compare(
    scene: Scene,
    targets: np.ndarray,
    known: np.ndarray,
    baseline: Built,
    exposures: Float[np.ndarray, "n 3"],
    out: Path,
) -> tuple[dict[str, Metric], dict[int, Image.Image]]:
    """Save the renders of the targets; return PSNR and coverage, and the renders that pictures show, by view.

    The first are at photos that coloured the mesh, and at the targets, which did not. No other render stays in memory.
    """
    (out / BASELINE_RENDERS).mkdir(exist_ok=True)
    pictured = {*_pictured(targets).tolist(), *_pictured(known).tolist()}
    found, shown = dict[tuple[int, str], tuple[float, float, float]](), dict[int, Image.Image]()
    views, sizes = [*targets.tolist(), *known.tolist()], {"": scene.config.check_px, "_full": FULL_PX}
    renders = checks.render_views(baseline.best, scene.views, views, exposures)
    for place, (view, render) in enumerate(zip(views, renders, strict=True)):
        if place < len(targets):
            render.save(out / BASELINE_RENDERS / image_name(scene.views.photo_id[view]))
        for suffix, px in sizes.items():
            (one,) = checks.compare_views(scene.images, scene.masks, scene.views, [view], [render], px)
            found[view, suffix] = one.psnr, one.covered_share, one.flat_psnr
        if view in pictured:
            shown[view] = render
    figures: dict[str, Metric] = {
        f"{prefix}{name}{suffix}": checks.mean_finite([found[view, suffix][number] for view in chosen])
        for prefix, chosen in (("", known.tolist()), ("target_", targets.tolist()))
        for suffix in sizes
        for number, name in enumerate(("render_psnr", "covered_share", "flat_psnr"))
    }
    return figures, shown


def _pictured(chosen: np.ndarray) -> np.ndarray:
    """Return the views that a picture shows."""
    return chosen[evenly_spread(np.arange(len(chosen)), PICTURE_ROWS)]


def _draw(
    out: Path,
    scene: Scene,
    targets: np.ndarray,
    known: np.ndarray,
    renders: dict[int, Image.Image],
    train: Built,
    baseline: Built,
) -> dict[str, str]:
    """Write the pictures and return them by caption."""
    pictures = {"The mesh made of train photos, from above: colours and shape": "top_view.png"}
    checks.top_view(train.best).save(out / "top_view.png")
    sheets = (
        ("Held-out photos, the mesh made without them, its shape", "photo_and_mesh.png", targets),
        ("Photos that coloured the mesh, the mesh, its shape", "used_photo_and_mesh.png", known),
    )
    for caption, name, chosen in sheets:
        if len(chosen):
            rows: list[int] = _pictured(chosen).tolist()
            shown = [renders[view] for view in rows]
            sheet = checks.side_by_side(scene.images, baseline.best, scene.views, rows, shown, PICTURE_PX)
            sheet.save(out / name)
            pictures[caption] = name
    return pictures


def _doubts(figures: dict[str, Metric]) -> list[str]:
    """Say what makes the mesh less than it should be."""
    notes = []
    points, covered = (float(figures[name] or 0) for name in ("points", "covered_share"))
    if points < FEW_POINTS:
        notes.append(f"only {points:.0f} fused points carry the surface: its shape is coarse")
    if covered < LOW_COVERAGE:
        notes.append(f"the mesh covers only {100 * covered:.0f} % of the photos")
    for whose, prefix in (("held-out photos", "target_"), ("the photos that coloured it", "")):
        shown, flat = figures[f"{prefix}render_psnr"], figures[f"{prefix}flat_psnr"]
        if shown is not None and flat is not None and float(shown) <= float(flat):
            notes.append(
                f"the mesh shows {whose} no better than one colour for each would"
                f" ({float(shown):.1f} dB against {float(flat):.1f} dB): its shape is wrong"
            )
    return notes


def _remarks(figures: dict[str, Metric]) -> list[str]:
    """Say what was dealt with, and is good to know."""
    spread = float(figures["baseline_exposure_spread"] or 0)
    if spread <= UNEVEN:
        return []
    return [f"exposures differ by a factor of {spread:.1f}: evened out in the mesh's colours, not in the photos"]
