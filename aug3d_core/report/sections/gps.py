"""The distance between each camera and its GPS position."""

from __future__ import annotations

import json

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.geometry.transforms import centres
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.sfm.files import WORLD


def gps_errors(run: ReportedRun) -> Float[np.ndarray, "n 3"]:
    """Return camera minus GPS position of each view [m east, north, up]; NaN without GPS; no rows if GPS was not used."""
    views, photos, world = run.views, run.table("photos", PHOTO_TABLE), run.file("sfm", WORLD)
    if views is None or photos.empty or world is None:
        return np.zeros((0, 3))
    told = json.loads(world.read_text())
    if not told["metric"] or not told["origin"]:
        return np.zeros((0, 3))
    lat_deg, lon_deg, alt_m = told["origin"].values()
    geodetic = photos.set_index("photo_id").loc[views.photo_id, ["lat_deg", "lon_deg", "alt_m"]].to_numpy(float)
    level = alt_m or 0.0  # GPS may lack the altitude: east and north hardly depend on it
    known = np.where(np.isfinite(geodetic), geodetic, [np.nan, np.nan, level])
    errors = centres(views.cam_from_world) - enu_from_geodetic(known, np.array([lat_deg, lon_deg, level]))
    unknown_up = ~np.isfinite(geodetic[:, 2]) | (alt_m is None)
    errors[unknown_up, 2] = np.nan
    return errors
