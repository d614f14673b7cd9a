"""The sfm stage: photo table and matches -> posed views, points and tracks in the world."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.errors import InputError
from aug3d_core.geometry.transforms import centres
from aug3d_core.photos.table import read_photos
from aug3d_core.sfm import export
from aug3d_core.sfm.align import Alignment, align
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.focal import settle_focal
from aug3d_core.sfm.mapping import SMALLEST_MODEL, reconstruct
from aug3d_core.sfm.pairs import gps_positions
from aug3d_core.sfm.picture import draw_map
from aug3d_core.stage import Inputs, Outcome, Progress
from aug3d_core.store import layout


def run(inputs: Inputs, config: SfmConfig, out: Path, progress: Progress) -> Outcome:
    """Reconstruct the photographs and write the largest model; the others are kept beside it."""
    pycolmap.logging.minloglevel = 1  # warnings only: mapping writes dozens of lines per photograph
    photos, images = read_photos(inputs["photos"]), inputs["photos"] / layout.PHOTO_IMAGES
    with tempfile.TemporaryDirectory(dir=out) as scratch:
        database = Path(shutil.copy(inputs["matching"] / layout.FEATURES, scratch))  # opening it may write to it
        models = reconstruct(images, database, len(photos), config, progress)
    if not models:
        raise _nothing_found(len(photos))
    progress(len(photos), len(photos), "photographs placed; writing them undistorted")
    settled = settle_focal(models[0], photos)
    model = settled.model
    alignment = align_model(model, photos, np.random.default_rng(config.seed))
    arrays = _write(model, alignment, photos, images, out)
    _write_components([model, *models[1:]], photos, out)
    metrics = _metrics(model, arrays, alignment, photos, len(models))
    metrics |= {
        "focal_source": settled.source,
        "focal_exif_over_refined_error": settled.exif_over_refined,
    }
    notes = _notes(model, models, alignment, photos)
    return Outcome(
        metrics=metrics,
        state="degraded" if metrics["registered_share"] < 0.5 or alignment.problem else "ok",
        notes=notes,
        pictures={"Points and cameras from above": layout.SFM_MAP},
    )


def align_model(model: pycolmap.Reconstruction, photos: pd.DataFrame, rng: np.random.Generator) -> Alignment:
    """Move the model into the world."""
    gps_enu_m, _ = gps_positions(photos)
    placed = [export.photo_id(image) for image in export.registered(model)]
    arrays = export.to_arrays(model)
    at = centres(arrays.views.cam_from_world)
    depth = np.linalg.norm(arrays.points.xyz[arrays.tracks.point] - at[arrays.tracks.view], axis=1)
    alignment = align(arrays.views.cam_from_world, arrays.points.xyz, float(np.median(depth)), gps_enu_m[placed], rng)
    fit = alignment.world_from_model
    model.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(fit.rotation), fit.translation))
    return alignment


def _write(
    model: pycolmap.Reconstruction, alignment: Alignment, photos: pd.DataFrame, images: Path, out: Path
) -> export.Arrays:
    arrays = export.to_arrays(model)
    arrays.views.save(out / layout.VIEWS)
    arrays.points.save(out / layout.POINTS)
    arrays.tracks.save(out / layout.TRACKS)
    export.write_undistorted(model, images, out / layout.VIEW_IMAGES)
    (out / layout.COLMAP_MODEL).mkdir()
    model.write_binary(out / layout.COLMAP_MODEL)
    world = world_record(alignment, photos)
    (out / layout.WORLD).write_text(json.dumps(world, indent=1))
    draw_map(arrays.views, arrays.points, world["unit"], out / layout.SFM_MAP)
    return arrays


def world_record(alignment: Alignment, photos: pd.DataFrame) -> dict[str, Any]:
    """Return what `world.json` says. The origin is where on earth (0, 0, 0) is, its altitude null if GPS had none."""
    unit = "m" if alignment.metric else "scene unit"
    record = {"metric": alignment.metric, "unit": unit, "up_from": alignment.up_from}
    if not alignment.metric:
        return record | {"origin": None, "gps_residual_m_median": None}
    lat_deg, lon_deg, alt_m = gps_positions(photos)[1]
    alt_m = float(alt_m + alignment.up_offset_m) if np.isfinite(photos["alt_m"].to_numpy()).any() else None
    return record | {
        "origin": {"lat_deg": float(lat_deg), "lon_deg": float(lon_deg), "alt_m": alt_m},
        "gps_residual_m_median": float(np.nanmedian(alignment.residual_m)),
    }


def _write_components(models: list[pycolmap.Reconstruction], photos: pd.DataFrame, out: Path) -> None:
    components, placed = [], set()
    for number, model in enumerate(models):
        folder = layout.COLMAP_MODEL if number == 0 else f"{layout.OTHER_MODELS}/{number}"
        if number:
            (out / folder).mkdir(parents=True)
            model.write_binary(out / folder)
        ids = [export.photo_id(image) for image in export.registered(model)]
        placed.update(ids)
        components.append({"photo_ids": ids, "points": model.num_points3D(), "folder": folder})
    lost = [int(photo_id) for photo_id in photos["photo_id"] if photo_id not in placed]
    record = {"components": components, "in_no_component": lost}
    (out / layout.COMPONENTS).write_text(json.dumps(record, indent=1))


def _metrics(
    model: pycolmap.Reconstruction, arrays: export.Arrays, alignment: Alignment, photos: pd.DataFrame, components: int
) -> dict[str, Any]:
    camera = model.camera(export.registered(model)[0].camera_id)
    heights = centres(arrays.views.cam_from_world)[:, 2]
    return {
        "photos": len(photos),
        "registered": len(arrays.views),
        "registered_share": len(arrays.views) / len(photos),
        "points": len(arrays.points.xyz),
        "observations": len(arrays.tracks.point),
        "reprojection_px": model.compute_mean_reprojection_error(),
        "track_length_mean": len(arrays.tracks.point) / max(1, len(arrays.points.xyz)),
        "gps_residual_m_median": float(np.nanmedian(alignment.residual_m)) if alignment.metric else None,
        "camera_height_m_median" if alignment.metric else "camera_height_units_median": float(np.median(heights)),
        "up_from": alignment.up_from,
        "camera_model": camera.model_name,
        "focal_px": camera.mean_focal_length(),
        "components": components,
    }


def _notes(
    model: pycolmap.Reconstruction, models: list[pycolmap.Reconstruction], alignment: Alignment, photos: pd.DataFrame
) -> tuple[str, ...]:
    notes = []
    placed = {export.photo_id(image) for image in export.registered(model)}
    lost = [name for photo, name in zip(photos["photo_id"], photos["name"], strict=True) if photo not in placed]
    if lost:
        names = ", ".join(lost[:5]) + (", ..." if len(lost) > 5 else "")
        notes.append(f"{len(lost)} of {len(photos)} photographs could not be placed: {names}")
    if len(models) > 1:
        sizes = ", ".join(str(other.num_reg_images()) for other in models[1:])
        notes.append(f"the photographs fall into {len(models)} parts; the largest is used, the others hold {sizes}")
    if alignment.problem:
        notes.append(f"GPS is not used, the scale is nominal: {alignment.problem}")
    elif not alignment.metric:
        notes.append("no GPS: the scale is nominal, with the median camera 50 scene units above the ground")
    return tuple(notes)


def _nothing_found(photos: int) -> InputError:
    return InputError(
        f"no scene could be reconstructed: no {SMALLEST_MODEL} of the {photos} photographs hold together",
        "Use photographs of one scene in which neighbours overlap by 60 % or more, sharp and with texture.",
    )
