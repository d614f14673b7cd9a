"""What the viewer reads of a finished scene. What a scene lacks is named, and the rest is shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.domes.cameras import Cameras
from aug3d_core.domes.files import CAMERAS
from aug3d_core.export.finished import MESH_FILES, mesh_of
from aug3d_core.export.glb import glb_of
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.photos.files import PHOTO_TABLE, image_name
from aug3d_core.run.errors import Aug3dError
from aug3d_core.sfm.files import POINTS, TRACKS, UNPLACED, VIEW_IMAGES, VIEWS
from aug3d_core.split.files import SPLIT_TABLE, read_roles

# Of each step of a run. Data set and model are read whole by who predicts; a photograph is read when it is asked for
READ = {
    "photos": (PHOTO_TABLE,),
    "sfm": (VIEWS, POINTS, TRACKS, UNPLACED),
    "grouping": (SPLIT_TABLE, GROUPS),
    "sampling": (CAMERAS,),
    "surface": MESH_FILES,
}
STEPS = tuple(READ)


@dataclass(frozen=True)
class Finished:
    """A scene as it is shown: arrays of its photographs with a pose are by row of `views`."""

    name: str
    views: Views
    names: Mapping[int, str]  # of photographs, by id
    roles: tuple[str, ...]  # in the split; "" where there is none
    group: Int[np.ndarray, " n"]  # the first that holds a photograph; -1 for none
    error_px: Float[np.ndarray, " n"]  # mean reprojection error; NaN if it sees no point
    points: Points
    unplaced: int  # photographs without a pose
    domes: Cameras | None
    mesh_glb: bytes  # y up, about the middle; empty for none
    middle_in_world: Float[np.ndarray, " 3"]
    lacks: tuple[str, ...]  # what is not shown, and why


def read_finished(name: str, folder_of: Callable[[str], Path]) -> Finished:
    """Read a scene. folder_of: returns the files of a step of its run, or raises why there are none.

    Raises what `folder_of` raises for `sfm`, without which nothing is anywhere; all else is left out and named.
    """
    sfm, lacks = folder_of("sfm"), list[str]()

    def having(step: str) -> Path | None:
        try:
            return folder_of(step)
        except Aug3dError as error:
            lacks.append(error.problem)
            return None

    views, points = Views.load(sfm / VIEWS), Points.load(sfm / POINTS)
    middle = np.round(np.median(centres(views.cam_from_world), axis=0))
    photos, grouping, sampling, surface = map(having, ("photos", "grouping", "sampling", "surface"))
    return Finished(
        name=name,
        views=views,
        names=_names(photos),
        roles=tuple(map(str, read_roles(grouping, len(views)))) if grouping else ("",) * len(views),
        group=_groups(grouping, len(views)),
        error_px=_errors(Tracks.load(sfm / TRACKS), points, len(views)),
        points=points,
        unplaced=len(pd.read_parquet(sfm / UNPLACED)) if (sfm / UNPLACED).is_file() else 0,
        domes=_domes(sampling),
        mesh_glb=glb_of(mesh_of(surface), middle) if surface else b"",
        middle_in_world=middle,
        lacks=tuple(lacks),
    )


def photograph(photo_id: int) -> str:
    """Return which file of the stage `sfm` shows an undistorted photograph."""
    return f"{VIEW_IMAGES}/{image_name(photo_id)}"


def packed(dataset: Path) -> Path:
    """Return where a data set holds its scene."""
    return dataset / SCENE_ZARR


def _names(photos: Path | None) -> dict[int, str]:
    if photos is None:
        return {}
    table = pd.read_parquet(photos / PHOTO_TABLE)
    return dict(zip(map(int, table["photo_id"]), map(str, table["name"]), strict=True))


def _groups(grouping: Path | None, views: int) -> Int[np.ndarray, " n"]:
    first = np.full(views, -1)
    if grouping is None:
        return first
    with np.load(grouping / GROUPS, allow_pickle=False) as file:
        members = file["members"]
    for number in range(len(members))[::-1]:
        row = members[number]
        first[row[row >= 0]] = number
    return first


def _errors(tracks: Tracks, points: Points, views: int) -> Float[np.ndarray, " n"]:
    count = np.bincount(tracks.view, minlength=views)
    total = np.bincount(tracks.view, points.error_px[tracks.point], views)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _domes(sampling: Path | None) -> Cameras | None:
    cameras = Cameras.load(sampling / CAMERAS) if sampling else None
    return cameras if cameras is not None and len(cameras) else None
