"""Bundle adjustment with ground control points: it bends a reconstruction to them, where that is seen to help.

Lens and poses hold each other up: over flat ground a lens that is a little wrong makes a bowl of a flight, which photographs
alone hardly tell, and no similarity takes out (James & Robson 2014). Control points are fixed in the adjustment, and the focal
length is freed, which they tell. Whether it helps is judged on points that had no part: each control point in its turn, and
those that only the bend made look wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.sfm.camera_model import adjustment_options, take_over, thinned, without_wrong_points
from aug3d_core.sfm.control import AXES, WRONG_PX, Survey, located, marked_points, surveyed_m

FEWEST = 4  # so that three are left where one judges
_MOST_FOLDS = 5  # points are left out some at a time where there are more
_POINTS_A_VIEW = 40  # that hold poses in trials
_WORTH = 0.8  # of the error of the world moved as a whole: what that of the adjusted one must be below


@dataclass(frozen=True)
class Adjusted:
    """What became of an adjustment. moved_m, adjusted_m: RMS error of control points that had no part, in the world moved as a
    whole and in the adjusted one; None where too few points tell, or adjusted models have no place for one.
    """

    survey: Survey
    used: bool
    moved_m: float | None = None
    adjusted_m: float | None = None


def adjust_to_control(model: pycolmap.Reconstruction, marks: pd.DataFrame, told: Survey) -> Adjusted:
    """Adjust a model, which is in the survey's world, in place, if that brings points that have no part nearer to their place.

    marks: the table of `aug3d_core.photos.control`. Residuals and errors of the survey are then those of the new model.
    """
    table, errors = told.table.set_index("point"), [f"error_{axis}_m" for axis in AXES]
    control, doubted = (told.table["point"][told.table["role"] == role].tolist() for role in ("control", "wrong"))
    moved = table[errors]
    if len(control) < FEWEST or moved.loc[control].isna().any(axis=None):
        return Adjusted(told, False)
    right = marks.loc[~marks["line"].isin(told.wrong_lines)]
    bent = _left_out(thinned(model, _POINTS_A_VIEW), right, control, doubted, told)
    judged = control + _explained(bent.loc[doubted], table.loc[doubted, "pixel_m"])
    # In numpy, since pandas leaves NaN out: a point whose rays no longer meet would count as exact.
    moved_m, bent_m = (
        float(np.sqrt(np.square(off.loc[judged].to_numpy()).sum(axis=1).mean())) for off in (moved, bent)
    )
    if not bent_m < _WORTH * moved_m:
        return Adjusted(told, False, moved_m, bent_m if np.isfinite(bent_m) else None)
    _bend(model, right, judged, told)
    without_wrong_points(model)
    table.loc[judged, "role"] = "control"
    off_m = _off_m(model, right, table.index.tolist(), told)
    table[[f"residual_{axis}_m" for axis in AXES]] = table[errors] = off_m.to_numpy()
    table.loc[judged, errors] = bent.loc[judged].to_numpy()
    return Adjusted(replace(told, table=table.reset_index()), True, moved_m, bent_m)


def _left_out(
    trial: pycolmap.Reconstruction, marks: pd.DataFrame, control: list[str], doubted: list[str], told: Survey
) -> pd.DataFrame:
    """Return the error of each point in a model that was adjusted to the control points but itself."""
    folds = min(len(control), _MOST_FOLDS)
    plans = [
        (control[fold::folds], [name for name in control if name not in control[fold::folds]]) for fold in range(folds)
    ]
    if doubted:
        plans.append((doubted, control))
    found = []
    for judged, given in plans:
        copy = pycolmap.Reconstruction(trial)
        _bend(copy, marks, given, told)
        found.append(_off_m(copy, marks, judged, told))
    return pd.concat(found)


def _explained(bent: pd.DataFrame, pixel_m: pd.Series) -> list[str]:
    """Return the points that were wrong in the world as it was, and are where others have them once it is bent."""
    return bent.index[np.linalg.norm(bent, axis=1) < WRONG_PX * pixel_m].tolist()


def _bend(model: pycolmap.Reconstruction, marks: pd.DataFrame, given: list[str], told: Survey) -> None:
    """Adjust a model in place to control points at their surveyed places.

    First by plain squares: marks that a bend put far off would weigh as little as wrong matches do.
    """
    with_control = pycolmap.Reconstruction(model)
    fixed = _add(with_control, marks.loc[marks["point"].isin(given)], told)
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in with_control.reg_image_ids():
        config.add_image(image_id)
    for point_id in fixed:
        config.add_constant_point(point_id)
    options = adjustment_options(refine_focal_length=True)
    robust = options.ceres.loss_function_type
    for loss in (pycolmap.LossFunctionType.TRIVIAL, robust):
        options.ceres.loss_function_type = loss
        pycolmap.create_default_bundle_adjuster(options, config, with_control).solve()
    take_over(model, with_control)


def _add(model: pycolmap.Reconstruction, marks: pd.DataFrame, told: Survey) -> list[int]:
    """Add control points and their marks to a model; return the ids of the points."""
    images = {int(model.image(one).name.partition(".")[0]): one for one in model.reg_image_ids()}
    added = []
    for _, of_point in marks.loc[marks["photo_id"].isin(list(images))].groupby("point", sort=False):
        track = pycolmap.Track()
        for photo_id, x_px, y_px in of_point[["photo_id", "x_px", "y_px"]].itertuples(index=False):
            points = model.image(images[photo_id]).points2D
            points.append(pycolmap.Point2D(np.array([x_px, y_px])))
            track.add_element(images[photo_id], len(points) - 1)
        place = surveyed_m(of_point[["lat_deg", "lon_deg", "alt_m"]].to_numpy(float)[:1], told)[0]
        added.append(model.add_point3D(place, track))
    return added


def _off_m(model: pycolmap.Reconstruction, marks: pd.DataFrame, names: list[str], told: Survey) -> pd.DataFrame:
    """Return how far from its surveyed place a model has each point: east, north and up, NaN where rays do not meet."""
    points = marked_points(model, marks.loc[marks["point"].isin(names)])
    off = [located(point)[0] - surveyed_m(point.geodetic[None], told)[0] for point in points]
    found = pd.DataFrame(
        np.reshape(off, (-1, 3)), [point.name for point in points], [f"error_{axis}_m" for axis in AXES]
    )
    return found.reindex(names)
