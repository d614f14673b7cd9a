"""The sfm stage from given poses: the same outputs, nothing adjusted, and refused where photographs contradict the poses."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap
from jaxtyping import Float

from aug3d_core.photos.files import PHOTO_IMAGES, read_control_marks, read_photos
from aug3d_core.poses.files import GIVEN_MODEL, Given, read_given
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.sfm import export
from aug3d_core.sfm.agreement import detail_agreement
from aug3d_core.sfm.camera_falloffs import measure_falloffs
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.decisions import sfm_decisions
from aug3d_core.sfm.files import FEATURES, SFM_MAP, UNPLACED
from aug3d_core.sfm.given_model import matched_keypoints, triangulated, with_given_points
from aug3d_core.sfm.mapping import SMALLEST_MODEL
from aug3d_core.sfm.rolling_shutter import measure_rolling_shutter, shutter_metrics, shutter_notes
from aug3d_core.sfm.unplaced import listed
from aug3d_core.sfm.write import (
    align_model,
    alignment_notes,
    flight_doming,
    lens_notes,
    model_metrics,
    write_outputs,
)

_LEAST_DETAIL = 0.5  # correlation; `agreement.py` says what right and wrong photographs have
_LEAST_FITTING = 0.2  # share; right poses: 0.42 and more on brighton_beach, 0.55 on the town; shuffled ones: 0.07
_FEWEST_MATCHED = 20
_MOST_CONTRADICTED = 0.5
_LOOSE_PX = 1.5  # at the working copies' size; structure from motion ends below 1


@dataclass(frozen=True)
class Check:
    """How points come about, and how well each photograph, by photo id, fits them: NaN if too little of it can be told."""

    build: Callable[[Sequence[Given]], pycolmap.Reconstruction]
    fit: Callable[[pycolmap.Reconstruction], Float[np.ndarray, " n"]]
    least: float
    meaning: str


def run(inputs: Inputs, config: SfmConfig, out: Path, progress: Progress) -> Outcome:
    """Take the given poses, leave out photographs that contradict theirs; raises InputError where most of them do."""
    pycolmap.logging.minloglevel = 1
    photos, images = read_photos(inputs["photos"]), inputs["photos"] / PHOTO_IMAGES
    given = read_given(inputs["poses"])
    progress(0, len(given), "poses being checked against the photographs")
    with tempfile.TemporaryDirectory(dir=out) as scratch:
        check = _by_matches(inputs, config, Path(scratch)) if "matching" in inputs else _by_points(inputs)
        model, fit, refused = agreeing(given, check, photos)
    progress(len(given), len(given), "poses checked; writing photographs undistorted")
    located, arrays = align_model(
        model, photos, read_control_marks(inputs["photos"]), np.random.default_rng(config.seed), None
    )
    falloffs = measure_falloffs(model, images, {})
    write_outputs(model, arrays, [], located, photos, images, out, falloffs)
    _unplaced(photos, given, refused).to_parquet(out / UNPLACED)
    doming = flight_doming(arrays, located, photos)
    shutter = measure_rolling_shutter(arrays.views, arrays.points, arrays.tracks, photos)
    metrics = (
        model_metrics(model, arrays, located, photos, doming, falloffs)
        | shutter_metrics(shutter)
        | {
            "components": 1,
            "photos_fit_median": float(np.nanmedian(fit)),
            "photos_contradicted": len(refused),
        }
    )
    loose = model.compute_mean_reprojection_error() > _LOOSE_PX
    read = shutter_notes(shutter)
    notes = (*_notes(photos, {one.photo_id for one in given}, refused, check), *read)
    if loose:
        notes += (
            f"poses and photographs fit loosely: {metrics['reprojection_px']:.1f} px between points and pictures",
        )
    few = len(arrays.views) < 0.5 * len(photos)
    return Outcome(
        metrics=metrics,
        state="degraded" if few or refused or loose or read or located.problem or (doming and doming.flagged) else "ok",
        notes=notes + alignment_notes(located) + lens_notes(model, photos) + (doming.notes if doming else ()),
        pictures={"Points and cameras from above": SFM_MAP},
        decisions=tuple(sfm_decisions(metrics)),
    )


def _by_points(inputs: Inputs) -> Check:
    """Take the points that came with the poses; what photographs show there must be alike."""
    source = pycolmap.Reconstruction(inputs["poses"] / GIVEN_MODEL)
    images = inputs["photos"] / PHOTO_IMAGES

    def fit(model: pycolmap.Reconstruction) -> Float[np.ndarray, " n"]:
        placed = export.registered(model)
        seen = [image.get_observation_points2D() for image in placed]
        files = [images / image.name for image in placed]
        view = np.repeat(np.arange(len(placed)), [len(points) for points in seen])
        point = np.unique([one.point3D_id for points in seen for one in points], return_inverse=True)[1]
        xy = np.array([one.xy for points in seen for one in points], float).reshape(-1, 2)
        return detail_agreement(files, view, point.ravel(), xy)

    return Check(lambda given: with_given_points(given, source), fit, _LEAST_DETAIL, "correlation at the given points")


def _by_matches(inputs: Inputs, config: SfmConfig, scratch: Path) -> Check:
    """Triangulate the matches; they must fit the poses."""
    features = Path(shutil.copy(inputs["matching"] / FEATURES, scratch))  # opening it may write to it
    images = inputs["photos"] / PHOTO_IMAGES

    def fit(model: pycolmap.Reconstruction) -> Float[np.ndarray, " n"]:
        placed = export.registered(model)
        matched = matched_keypoints(features, {image.image_id for image in placed})
        return np.array(
            [
                image.num_points3D / count if (count := matched[image.image_id]) >= _FEWEST_MATCHED else np.nan
                for image in placed
            ]
        )

    return Check(
        lambda given: triangulated(given, features, images, config.seed),
        fit,
        _LEAST_FITTING,
        "share of matched features that fit the poses",
    )


def agreeing(
    given: Sequence[Given], check: Check, photos: pd.DataFrame
) -> tuple[pycolmap.Reconstruction, Float[np.ndarray, " n"], list[int]]:
    """Return the model of the photographs that agree with it, how well each fits, and the ids of those left out.

    Raises InputError where most contradict their poses, or what is left cannot be checked.
    """
    refused: dict[int, float] = {}
    while True:
        model = check.build([one for one in given if one.photo_id not in refused])
        fit = check.fit(model)
        fit_of = dict(zip(map(export.photo_id, export.registered(model)), fit.tolist(), strict=True))
        wrong = {photo_id: each for photo_id, each in fit_of.items() if each < check.least}
        told = np.isfinite(fit).sum()
        most = len(refused) + len(wrong) > _MOST_CONTRADICTED * (len(refused) + told)
        if told < SMALLEST_MODEL or most or model.num_points3D() == 0:
            raise _contradiction(photos, refused | fit_of, refused | wrong, check)
        if not wrong:
            return model, fit, sorted(refused)
        # A wrong pose spoils the points of its neighbours too, so the rest is built again without it, and checked again.
        refused |= wrong


def _contradiction(
    photos: pd.DataFrame, fit_of: Mapping[int, float], wrong: Mapping[int, float], check: Check
) -> InputError:
    """Say what is wrong. fit_of: how each photograph fits, by photo id. wrong: those of them that do not."""
    names: dict[int, str] = dict(zip(photos["photo_id"], photos["name"], strict=True))
    fit = np.array(list(fit_of.values()))
    if wrong:
        problem = (
            f"the photographs contradict the given poses: {len(wrong)} of {len(fit)} do not fit, "
            f"{names[min(wrong, key=lambda photo_id: wrong[photo_id])]} first "
            f"({check.meaning}: median {np.nanmedian(fit):.2f}, at least {check.least} wanted)"
        )
    else:
        problem = (
            f"the given poses cannot be checked: of {len(fit)} photographs only {np.isfinite(fit).sum()} share enough "
            "points with others"
        )
    return InputError(
        problem,
        "Give the poses of exactly these photographs (the same names may stand for another flight), with their cameras; "
        "or leave out --poses to have them computed.",
    )


def _unplaced(photos: pd.DataFrame, given: Sequence[Given], refused: list[int]) -> pd.DataFrame:
    """Return `photo_id`, `name` and `reason` of the photographs that are left out."""
    placed = {one.photo_id for one in given}.difference(refused)
    table = photos.loc[~photos["photo_id"].isin(list(placed)), ["photo_id", "name"]].reset_index(drop=True)
    reasons = ["contradicts its given pose" if i in refused else "no given pose" for i in table["photo_id"]]
    return table.assign(reason=pd.Series(reasons, dtype="str"))


def _notes(photos: pd.DataFrame, given: set[int], refused: list[int], check: Check) -> tuple[str, ...]:
    names: dict[int, str] = dict(zip(photos["photo_id"], photos["name"], strict=True))
    without = [name for photo_id, name in names.items() if photo_id not in given]
    notes = []
    if refused:
        notes.append(
            f"{len(refused)} photographs are left out because they contradict their given pose ({check.meaning} under "
            f"{check.least}): {listed([names[photo_id] for photo_id in refused])}"
        )
    if without:
        notes.append(f"{len(without)} of {len(photos)} photographs have no given pose: {listed(without)}")
    return tuple(notes)
