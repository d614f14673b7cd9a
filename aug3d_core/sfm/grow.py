"""Start from an earlier reconstruction of most of today's photographs, so that only the new ones have to be placed.

The earlier cameras are kept as they were settled; poses and points are adjusted together with the new ones, and earlier poses
then taken back where the new ones bear them out (`hold.py`). The town's last 6 of 60 photographs, adjusted with the others, end
within a hundredth of a percent of the extent of where computing anew puts them.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.sfm import export
from aug3d_core.sfm.falloff import Falloff, read_falloffs
from aug3d_core.sfm.files import COLMAP_MODEL, COMPONENTS, FALLOFF, POINTS, TRACKS, VIEW_IMAGES, VIEWS

_LEAST = 0.5  # of today's photographs: less would rest the larger part of a scene on the smaller


@dataclass(frozen=True)
class Earlier:
    """An earlier model with today's ids, and what its cameras' corners lose.

    files: of its output. was: photo ids there by those of today. settled: photographs, placed or not, of which the poses were
    found together; those that came later were placed about these.
    """

    model: pycolmap.Reconstruction
    files: Path
    was: dict[int, int]
    falloffs: dict[int, Falloff | None]
    settled: int

    @property
    def known_falloffs(self) -> dict[int, Falloff]:
        """The falloffs that points told, by camera."""
        return {camera: falloff for camera, falloff in self.falloffs.items() if falloff}

    def images_as_they_are(
        self, grown: pycolmap.Reconstruction, falloffs: Mapping[int, Falloff | None]
    ) -> dict[int, Path]:
        """Return the images that undistorting again would give, for their cameras have not changed."""
        same = {
            image.name
            for image in (self.model.image(image_id) for image_id in self.model.reg_image_ids())
            if np.array_equal(self.model.camera(image.camera_id).params, grown.camera(image.camera_id).params)
            and falloffs[image.camera_id] == self.falloffs[image.camera_id]
        }
        folder = self.files / VIEW_IMAGES
        return {now: folder / image_name(was) for now, was in self.was.items() if image_name(now) in same}

    def arrays(self) -> export.Arrays:
        """Read what the model holds, as it was written, with today's photo ids."""
        views, now = Views.load(self.files / VIEWS), {was: now for now, was in self.was.items()}
        views = replace(views, photo_id=np.array([now[was] for was in views.photo_id.tolist()]))
        return export.Arrays(views, Points.load(self.files / POINTS), Tracks.load(self.files / TRACKS))


def find_earlier(photos: pd.DataFrame, database: Path, folder: Path | None) -> Earlier | None:
    """Return the largest earlier model that is a true part of today's scene; the newest of equals.

    Its photographs must all be among today's, with the same keypoints, and there must be new ones: without any, what changed
    is the matches.
    """
    best: Earlier | None = None
    today = dict(zip(photos["sha256"], photos["photo_id"], strict=True))
    for files in sorted(folder.iterdir()) if folder is not None and folder.exists() else []:
        components = json.loads((files / COMPONENTS).read_text())
        was = components["photo_sha256"]
        if len(was) >= len(photos) or not set(was) <= set(today):
            continue
        model = pycolmap.Reconstruction(files / COLMAP_MODEL)
        if model.num_reg_images() < max(_LEAST * len(photos), 0 if best is None else len(best.was) + 1):
            continue
        now = {export.photo_id(image): int(today[was[export.photo_id(image)]]) for image in export.registered(model)}
        renumbered = _renumbered(model, now, database)
        if renumbered is not None:
            grown, camera_was = renumbered
            falloffs = read_falloffs(files / FALLOFF)
            best = Earlier(
                grown,
                files,
                {new: old for old, new in now.items()},
                {new: falloffs[old] for new, old in camera_was.items()},
                components.get("settled", len(was)),
            )
    return best


def _renumbered(
    model: pycolmap.Reconstruction, now: dict[int, int], database: Path
) -> tuple[pycolmap.Reconstruction, dict[int, int]] | None:
    """Return the model with the database's ids, and its own ids of cameras by these; None if keypoints differ, or cameras are
    shared otherwise.

    now: photo ids by those of the model.
    """
    with pycolmap.Database.open(database) as opened:
        entered = {image.name: image for image in opened.read_all_images()}
        grown, camera_was, image_now = pycolmap.Reconstruction(), {}, {}
        for image in export.registered(model):
            new = entered[image_name(now[export.photo_id(image)])]
            keypoints = opened.read_keypoints(new.image_id)[:, :2].astype(float)
            if not np.array_equal(keypoints, np.array([point.xy for point in image.points2D]).reshape(-1, 2)):
                return None
            if camera_was.setdefault(new.camera_id, image.camera_id) != image.camera_id:
                return None
            if not grown.exists_camera(new.camera_id):
                grown.add_camera_with_trivial_rig(_with_id(model.camera(image.camera_id), new.camera_id))
            entry = pycolmap.Image(new.name, keypoints, camera_id=new.camera_id, image_id=new.image_id)
            grown.add_image_with_trivial_frame(entry, image.cam_from_world())
            image_now[image.image_id] = new.image_id
    for point_id in sorted(model.point3D_ids()):
        point, track = model.point3D(point_id), pycolmap.Track()
        for element in point.track.elements:
            track.add_element(image_now[element.image_id], element.point2D_idx)
        grown.add_point3D(point.xyz, track, point.color)
    return grown, camera_was


def _with_id(camera: pycolmap.Camera, camera_id: int) -> pycolmap.Camera:
    other = copy.deepcopy(camera)
    other.camera_id = camera_id
    return other
