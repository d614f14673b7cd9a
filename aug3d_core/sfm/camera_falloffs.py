"""The falloff of each camera of a reconstruction, from its points and the photographs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Float
from PIL import Image

from aug3d_core.sfm import export
from aug3d_core.sfm.falloff import Falloff, fit_falloff

_WIDTH_PX = 320  # of the small pictures that points are looked up in: a pixel of these shows what is about a point


def measure_falloffs(
    model: pycolmap.Reconstruction, photos: Path, known: Mapping[int, Falloff | None]
) -> dict[int, Falloff | None]:
    """Return the falloff of each camera by its id, None where points do not tell; what is known is kept.

    photos: folder of the working copies.
    """
    images, found = export.registered(model), dict(known)
    for camera_id in sorted({image.camera_id for image in images}.difference(known)):
        camera = model.camera(camera_id)
        point, view, grey, rays = [], [], [], []
        for index, image in enumerate(one for one in images if one.camera_id == camera_id):
            seen = image.get_observation_points2D()
            xy = np.array([observed.xy for observed in seen], float).reshape(-1, 2)
            point.append(np.array([observed.point3D_id for observed in seen], np.int64))
            view.append(np.full(len(seen), index))
            grey.append(_looked_up(photos / image.name, xy))
            rays.append(camera.cam_from_img(xy))
        fx, fy, cx, cy = export.undistorted_camera(camera).params
        corner = math.hypot(cx / fx, cy / fy)
        off_axis = np.linalg.norm(np.concatenate(rays), axis=1)
        found[camera_id] = fit_falloff(
            np.concatenate(point), np.concatenate(view), np.concatenate(grey), off_axis, corner
        )
    return found


def _looked_up(photo: Path, xy: Float[np.ndarray, "t 2"]) -> Float[np.ndarray, " t"]:
    """Return how bright a photograph is about its pixels, in levels of grey."""
    with Image.open(photo) as image:
        smaller = _WIDTH_PX / image.width
        size = (_WIDTH_PX, max(1, round(image.height * smaller)))
        grey = np.asarray(image.convert("L").resize(size, Image.Resampling.BOX), float)
    column, row = np.floor(xy * smaller).astype(int).T
    return grey[row.clip(0, size[1] - 1), column.clip(0, size[0] - 1)]
