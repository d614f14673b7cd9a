"""Move a finished reconstruction into the world, and write it with its records: what every later stage reads."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pycolmap
from jaxtyping import Float

from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.photos.files import PHOTO_MASKS
from aug3d_core.run.stage import Metric
from aug3d_core.sfm import export
from aug3d_core.sfm.align import Alignment, align, align_to_control
from aug3d_core.sfm.camera_model import EXIF, Chosen
from aug3d_core.sfm.control import Survey, surveyed
from aug3d_core.sfm.control_adjustment import Adjusted, adjust_to_control
from aug3d_core.sfm.doming import Doming, measure_doming
from aug3d_core.sfm.falloff import Falloff, write_falloffs
from aug3d_core.sfm.files import (
    COLMAP_MODEL,
    COMPONENTS,
    CONTROL_POINTS,
    FALLOFF,
    OTHER_MODELS,
    POINTS,
    SFM_MAP,
    TRACKS,
    VIEW_IMAGES,
    VIEW_MASKS,
    VIEWS,
    WORLD,
)
from aug3d_core.sfm.gimbal import doming_by_gimbal
from aug3d_core.sfm.pairs import gps_positions
from aug3d_core.sfm.picture import draw_map
from aug3d_core.sfm.straighten import straighten


@dataclass(frozen=True)
class Located:
    """The world of a model. origin: latitude, longitude and height that `alignment` is about, NaN without any.

    taken_out: the bend that poses had until they were straightened, None if they were not.
    """

    alignment: Alignment
    origin: Float[np.ndarray, " 3"]
    control: Adjusted | None = None
    taken_out: Doming | None = None

    @property
    def survey(self) -> Survey | None:
        """What control points tell, where there are any."""
        return self.control and self.control.survey

    @property
    def problem(self) -> str:
        """Why positions that exist were not used."""
        return self.alignment.problem or (self.survey.problem if self.survey else "")


def align_model(
    model: pycolmap.Reconstruction,
    photos: pd.DataFrame,
    marks: pd.DataFrame | None,
    rng: np.random.Generator,
    chosen: Chosen | None,
) -> tuple[Located, export.Arrays]:
    """Move the model into the world; return how, and what it then holds.

    marks: of ground control points. chosen: how the model was adjusted, so that it may be to these, or straightened; None: its
    poses move as a whole.
    """
    placed = [export.photo_id(image) for image in export.registered(model)]
    told = surveyed(model, marks)
    if marks is not None and told and told.world_from_model:
        _move(model, told.world_from_model)
        control = adjust_to_control(model, marks, told) if chosen else Adjusted(told, False)
        arrays = export.to_arrays(model)
        gps_enu_m = gps_about(told.origin, photos)[placed]
        alignment = align_to_control(arrays.views.cam_from_world, arrays.points.xyz, gps_enu_m)
        located = Located(alignment, told.origin, control)
    else:
        arrays, taken_out = export.to_arrays(model), None
        alignment, origin = by_gps(arrays, photos, rng), gps_positions(photos)[1]
        if chosen:
            gps_enu_m = believed(alignment, photos)[placed]
            taken_out = straighten(model, gps_enu_m, alignment.world_from_model, chosen.focal_from != EXIF)
        if taken_out:
            arrays = export.to_arrays(model)
            alignment = by_gps(arrays, photos, rng)
        located = Located(alignment, origin, told and Adjusted(told, False), taken_out)
    _move(model, located.alignment.world_from_model)
    return located, arrays.moved(located.alignment.world_from_model)


def _move(model: pycolmap.Reconstruction, fit: Similarity) -> None:
    model.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(fit.rotation), fit.translation))


def gps_about(origin: Float[np.ndarray, " 3"], photos: pd.DataFrame) -> Float[np.ndarray, "n 3"]:
    """Return ENU metres of all photographs about a place (latitude, longitude, height), NaN without GPS."""
    geodetic = photos[["lat_deg", "lon_deg", "alt_m"]].fillna({"alt_m": origin[2]}).to_numpy(float)
    return enu_from_geodetic(geodetic, origin)


def by_gps(arrays: export.Arrays, photos: pd.DataFrame, rng: np.random.Generator) -> Alignment:
    """Find the world of what a model holds, by GPS where there is any. photos: the whole table."""
    placed = arrays.views.photo_id
    gps_enu_m, swapped_enu_m = gps_positions(photos)[0], _swapped_positions(photos)
    at = centres(arrays.views.cam_from_world)
    depth = np.linalg.norm(arrays.points.xyz[arrays.tracks.point] - at[arrays.tracks.view], axis=1)
    return align(
        arrays.views.cam_from_world,
        arrays.points.xyz,
        float(np.median(depth)),
        gps_enu_m[placed],
        rng,
        None if swapped_enu_m is None else swapped_enu_m[placed],
    )


def write_outputs(
    model: pycolmap.Reconstruction,
    arrays: export.Arrays,
    others: Sequence[pycolmap.Reconstruction],
    located: Located,
    photos: pd.DataFrame,
    images: Path,
    out: Path,
    falloffs: Mapping[int, Falloff | None],
    known: Mapping[int, Path] | None = None,
    settled: int | None = None,
) -> None:
    """Write the model, which is in the world, as arrays, undistorted images, COLMAP files, records and a map.

    arrays: what the model holds. others: reconstructions of further photographs, each in a frame of its own. images: folder
    of the photographs' working copies, beside that of their masks. falloffs: of cameras by id. known: undistorted images that
    exist already, by photo id. settled: of how many photographs the poses were found together; None: of all.
    """
    arrays.views.save(out / VIEWS)
    arrays.points.save(out / POINTS)
    arrays.tracks.save(out / TRACKS)
    export.write_undistorted(model, images, out / VIEW_IMAGES, known or {}, falloffs)
    write_falloffs(falloffs, out / FALLOFF)
    export.write_undistorted_masks(model, images.with_name(PHOTO_MASKS), out / VIEW_MASKS)
    folders = [COLMAP_MODEL, *(f"{OTHER_MODELS}/{number}" for number in range(1, len(others) + 1))]
    for each, folder in zip([model, *others], folders, strict=True):
        (out / folder).mkdir(parents=True, exist_ok=True)
        each.write_binary(out / folder)
    components = _components([model, *others], folders, photos)
    _write_json(components if settled is None else components | {"settled": settled}, out / COMPONENTS)
    world = world_record(located)
    _write_json(world, out / WORLD)
    if located.survey:
        located.survey.table.to_parquet(out / CONTROL_POINTS)
    draw_map(arrays.views, arrays.points, world["unit"], out / SFM_MAP)


def world_record(located: Located) -> dict[str, Any]:
    """Return what `world.json` says. The origin is where on earth (0, 0, 0) is, its altitude null if nothing told it."""
    alignment = located.alignment
    unit = "m" if alignment.metric else "scene unit"
    record = {"metric": alignment.metric, "unit": unit, "up_from": alignment.up_from}
    if not alignment.metric:
        return record | {"origin": None, "gps_residual_m_median": None}
    lat_deg, lon_deg, alt_m = located.origin
    alt_m = float(alt_m + alignment.up_offset_m) if np.isfinite(alignment.up_offset_m) else None
    return record | {
        "origin": {"lat_deg": float(lat_deg), "lon_deg": float(lon_deg), "alt_m": alt_m},
        "gps_residual_m_median": _median(alignment.residual_m),
    }


def _median(values: Float[np.ndarray, " n"]) -> float | None:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else None


def believed(alignment: Alignment, photos: pd.DataFrame) -> Float[np.ndarray, "n 3"]:
    """Return the positions of all photographs by GPS, NaN where there is none, or none that fits."""
    gps_enu_m = gps_positions(photos)[0]
    return gps_enu_m if alignment.metric else np.full_like(gps_enu_m, np.nan)


def flight_doming(arrays: export.Arrays, located: Located, photos: pd.DataFrame) -> Doming | None:
    """Return the bend of the reconstructed flight by what tells it best, None where nothing does."""
    poses = arrays.views.cam_from_world
    gps_enu_m = believed(located.alignment, photos)[arrays.views.photo_id]
    found = [doming_by_gimbal(poses), measure_doming(centres(poses), gps_enu_m)]
    return min((one for one in found if one), key=lambda one: one.sigma_pct, default=None)


def model_metrics(
    model: pycolmap.Reconstruction,
    arrays: export.Arrays,
    located: Located,
    photos: pd.DataFrame,
    doming: Doming | None,
    falloffs: Mapping[int, Falloff | None],
) -> dict[str, Metric]:
    """Return the figures of a model that was written; those of the lens are the first photograph's."""
    alignment = located.alignment
    camera_id = export.registered(model)[0].camera_id
    camera, falloff = model.camera(camera_id), falloffs[camera_id]
    heights = centres(arrays.views.cam_from_world)[:, 2]
    return {
        "photos": len(photos),
        "registered": len(arrays.views),
        "registered_share": len(arrays.views) / len(photos),
        "points": len(arrays.points.xyz),
        "observations": len(arrays.tracks.point),
        "reprojection_px": model.compute_mean_reprojection_error(),
        "track_length_mean": len(arrays.tracks.point) / max(1, len(arrays.points.xyz)),
        "gps_residual_m_median": _median(alignment.residual_m) if alignment.metric else None,
        "camera_height_m_median" if alignment.metric else "camera_height_units_median": float(np.median(heights)),
        "up_from": alignment.up_from,
        "doming_pct": doming and doming.pct,
        "doming_sigma_pct": doming and doming.sigma_pct,
        "doming_taken_out_pct": located.taken_out and located.taken_out.pct,
        "doming_taken_out_by": located.taken_out and located.taken_out.told_by,
        "doming_taken_out_sigma_pct": located.taken_out and located.taken_out.sigma_pct,
        "camera_model": camera.model_name,
        "focal_px": camera.mean_focal_length(),
        "corner_light": falloff and falloff.corner_light,
        "corner_light_sigma": falloff and falloff.corner_light * falloff.sigma,
        "light_evened": falloff is not None and falloff.evened,
    } | (_survey_metrics(located.control) if located.control else {})


def _survey_metrics(control: Adjusted) -> dict[str, Metric]:
    told = control.survey
    metrics: dict[str, Metric] = {
        "control_adjusted": control.used,
        "control_left_out_m_moved": control.moved_m,
        "control_left_out_m_adjusted": control.adjusted_m,
    }
    for role in ("control", "check"):
        rms_m = told.rms_m(role) if told.world_from_model else None
        metrics[f"{role}_points"] = int((told.table["role"] == role).sum()) if told.world_from_model else 0
        metrics[f"{role}_error_horizontal_m"], metrics[f"{role}_error_up_m"] = rms_m or (None, None)
    return metrics


def alignment_notes(located: Located) -> tuple[str, ...]:
    """Say in words what control points and GPS were not used for."""
    told = located.survey
    notes = () if told is None else told.remarks
    if told is not None and told.problem:
        notes += (f"the control points are not used: {told.problem}",)
    return notes + _gps_notes(located.alignment)


def lens_notes(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> tuple[str, ...]:
    """Say how much undistorted photographs lack of lenses that fold the picture over. photos: the whole table."""
    a_photo = {image.camera_id: export.photo_id(image) for image in export.registered(model)}
    cut = {one: share for one in sorted(a_photo) if (share := export.share_cut(model.camera(one)))}
    return tuple(
        f"the lens of {photos['camera'].iloc[a_photo[one]]} ({model.camera(one).model_name}) folds the picture over before the "
        f"edge of the frame: {100 * share:.0f} % of each photograph, the rim, is cut off"
        for one, share in cut.items()
    )


def _gps_notes(alignment: Alignment) -> tuple[str, ...]:
    if alignment.problem:
        return (f"GPS is not used, the scale is nominal: {alignment.problem}",)
    if not alignment.metric:
        return ("no GPS: the scale is nominal, with the median camera 50 scene units above the ground",)
    if alignment.up_from == "gravity":
        return ("GPS altitudes do not fix the vertical, so it is taken from cameras and ground",)
    return ()


def _swapped_positions(photos: pd.DataFrame) -> Float[np.ndarray, "n 3"] | None:
    """Return the positions with latitude and longitude exchanged; None if they cannot be."""
    lon_deg = photos["lon_deg"].to_numpy(float)
    if not np.isfinite(lon_deg).any() or np.nanmax(np.abs(lon_deg)) > 90:
        return None
    return gps_positions(photos.rename(columns={"lat_deg": "lon_deg", "lon_deg": "lat_deg"}))[0]


def _components(
    models: Sequence[pycolmap.Reconstruction], folders: Sequence[str], photos: pd.DataFrame
) -> dict[str, Any]:
    components = [
        {
            "photo_ids": [export.photo_id(image) for image in export.registered(model)],
            "points": model.num_points3D(),
            "folder": folder,
        }
        for model, folder in zip(models, folders, strict=True)
    ]
    placed = {photo_id for component in components for photo_id in component["photo_ids"]}
    return {
        "components": components,
        "in_no_component": [int(photo_id) for photo_id in photos["photo_id"] if photo_id not in placed],
        "photo_sha256": photos["sha256"].tolist(),  # by photo_id: tells a later run which of its photographs these are
    }


def _write_json(record: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(record, indent=1))
