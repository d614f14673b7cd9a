"""COLMAP model, binary or text -> poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap

from aug3d_core.geometry.camera_models import Camera, checked_camera, checked_pose
from aug3d_core.poses.colmap_check import check_binary
from aug3d_core.poses.entry import Entry
from aug3d_core.run.errors import InputError


def read_colmap(folder: Path) -> list[Entry]:
    """Read every registered image; raises InputError that names folder, camera or image."""
    model = read_model(folder)
    cameras = {}
    for camera_id, camera in model.cameras.items():
        plain = Camera(camera.model_name, camera.width, camera.height, tuple(camera.params.tolist()))
        cameras[camera_id] = checked_camera(plain, f"{folder}, camera {camera_id}")
    entries, seen = [], {}
    for image_id in sorted(model.reg_image_ids()):
        image = model.image(image_id)
        where = f"{folder}, image {image_id} ({image.name})"
        if image.name in seen:
            raise InputError(f"{where} has the same name as image {seen[image.name]}", "Keep one of the two images.")
        seen[image.name] = image_id
        if not np.linalg.norm(image.cam_from_world().rotation.quat) > 0.5:  # its matrix would be that of no rotation
            raise InputError(f"{where}: the quaternion is zero, which is no rotation", "Mend or remove that image.")
        pose = checked_pose(np.asarray(image.cam_from_world().matrix()), where)
        entries.append(Entry(((image.name, cameras[image.camera_id]),), pose, where, image_id))
    if not entries:
        raise InputError(f"{folder} has no registered image", "Use a model with registered photographs.")
    return entries


def read_model(folder: Path) -> pycolmap.Reconstruction:
    """Open a model; raises InputError that names the folder or the file in it that is damaged."""
    check_binary(folder)
    try:
        return pycolmap.Reconstruction(folder)
    except Exception as error:  # damaged bytes can make pycolmap raise anything
        raise InputError(
            f"{folder} cannot be read as a COLMAP model: {str(error).splitlines()[0]}",
            "Copy the model again, or convert it with `colmap model_converter`.",
        ) from error
