"""Posed photographs from outside a scene -> a scene of their own, for a model that was trained elsewhere.

They come as a nerfstudio `transforms.json`. Where it names a point cloud (`ply_file_path`, as `aug3d export` writes it), the
ground is measured there; else the poses must be in the world of the scene that the model was trained on, and its ground is
taken.
"""

from __future__ import annotations

import hashlib
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8

from aug3d_core.dataset.bounds import depths_in, near_far
from aug3d_core.dataset.images import Fit, fit
from aug3d_core.dataset.projection import middle_ground
from aug3d_core.dataset.scene import BASELINE_ARRAYS, FINER, REAL, SPLITS, Scene
from aug3d_core.dataset.slab import Slab, slab_of
from aug3d_core.geometry.camera_models import same_shape, scaled
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.picture import PictureError, decoding_budget, opened_picture, rgb_of, take_memory
from aug3d_core.run.regular_file import MOST_TEXT_BYTES, content, json_content

_NO_CLOUD = "take ply_file_path out if the poses are in the world of the scene, else give points as aug3d writes them"
OUTLIER_SHARE, MARGIN_SHARE = 0.005, 0.1  # of the slab, as the stage dataset measures it unless told otherwise


def photo_names(file: Path) -> pd.DataFrame:
    """Return the photographs that pose files name, numbered in their order: `photo_id`, `name`."""
    names = [entry.names[0][0].removeprefix("./") for entry in read_transforms(file)]
    return pd.DataFrame({"photo_id": range(len(names)), "name": names})


def photos_digest(file: Path) -> str:
    """Digest of the poses and of every photograph that they name; raises InputError if one is missing."""
    digest = hashlib.sha256(content(file, MOST_TEXT_BYTES))
    for entry in read_transforms(file):
        photo = _photo(file, entry)
        try:
            digest.update(file_digest(photo).encode())
        except OSError as error:
            raise _unusable(photo, entry, error.strerror or str(error)) from error
    return digest.hexdigest()


def outside_scene(file: Path, trained_on: Scene) -> Scene:
    """Return the photographs at the size that the model knows, over their ground.

    Raises InputError for a photograph that is missing, distorted, or not of its camera's shape.
    """
    entries = read_transforms(file)
    size_px = (trained_on.width_px, trained_on.height_px)
    slab, points = _ground(file, trained_on.slab)
    images, fine, intrinsics, bounds, budget = [], [], [], [], decoding_budget()
    poses = homogeneous(invert(np.stack([entry.cam_from_world for entry in entries])))
    for entry, pose in zip(entries, poses, strict=True):
        crop, rgb, camera = _photograph(file, entry, size_px, budget)
        seen = depths_in(entry.cam_from_world, points) if points is not None else np.zeros(0)
        height = abs(float(slab.height(pose[:3, 3])))
        images.append(crop.colour(rgb))
        fine.append(crop.times(FINER).colour(rgb))
        intrinsics.append(camera)
        bounds.append(near_far(slab, pose, camera, size_px, seen if len(seen) else np.array([height, 2 * height])))
    count = len(entries)
    scene = replace(
        trained_on,
        images=np.stack(images),
        fine_images=np.stack(fine),
        alpha=np.full((count, *images[0].shape[:2]), 255, np.uint8),
        depth=np.zeros((count, *images[0].shape[:2]), np.float16),
        scaffold=np.zeros((count, *images[0].shape[:2]), np.float16),
        world_from_cam=poses,
        intrinsics=np.stack(intrinsics),
        near_far=np.stack(bounds),
        source=np.full(count, REAL, np.uint8),
        photo_id=np.arange(count, dtype=np.int32),
        dome_id=np.full(count, -1, np.int32),
        splits=np.full(count, SPLITS.index("support"), np.uint8),
        groups={name: members[:0] for name, members in trained_on.groups.items()},
        slab=slab,
        **{name: getattr(trained_on, name)[:0] for name in BASELINE_ARRAYS},
    )
    if points is None:
        return scene
    away = [np.linalg.norm(middle_ground(scene, view) - pose[:3, 3]) for view, pose in enumerate(poses)]
    return replace(scene, scale=float(np.median(away)))


def _ground(file: Path, otherwise: Slab) -> tuple[Slab, np.ndarray | None]:
    cloud = json_content(file).get("ply_file_path")
    if cloud is None:
        return otherwise, None
    try:
        if not isinstance(cloud, str):
            raise ValueError("it is no text")
        points = Mesh.load(file.parent / cloud).xyz.astype(float)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{file.name}: the point cloud {cloud} cannot be read ({error})",
            _NO_CLOUD,
        ) from error
    if not len(points) or not np.isfinite(points).all():
        raise InputError(
            f"{file.name}: the point cloud {cloud} holds no points, or some that are not finite", _NO_CLOUD
        )
    return slab_of(points, OUTLIER_SHARE, MARGIN_SHARE), points


def _photograph(
    file: Path, entry: Entry, size_px: tuple[int, int], budget: MemoryBudget
) -> tuple[Fit, UInt8[np.ndarray, "h w 3"], Float[np.ndarray, " 4"]]:
    """Return the crop of a photograph to the packed size, its colours, and its (fx, fy, cx, cy) at that size."""
    _, camera = entry.names[0]
    if camera.model != "PINHOLE":
        raise InputError(
            f"{entry.where} is distorted (camera model {camera.model})",
            "give undistorted photographs and their cameras",
        )
    photo = _photo(file, entry)
    try:
        with ExitStack() as held, opened_picture(photo) as (_, image):
            take_memory(image, budget, held)
            rgb = np.asarray(rgb_of(image))
    except PictureError as error:
        raise _unusable(photo, entry, str(error)) from error
    height, width = rgb.shape[:2]
    if not same_shape(camera, width, height):
        raise InputError(
            f"{entry.where}: the photograph is {width}x{height} px, its camera is of {camera.width}x{camera.height}",
            "give the photograph that the camera belongs to, or a copy resized without cropping",
        )
    crop = fit(width, height, *size_px)
    return crop, rgb, crop.intrinsics(np.array(scaled(camera, width, height).params))


def _photo(file: Path, entry: Entry) -> Path:
    try:
        path = file.parent / entry.names[0][0]
        path.stat()
    except FileNotFoundError as error:
        raise InputError(
            f"{entry.where}: the photograph {path} does not exist", "put it there, or mend file_path"
        ) from error
    except (OSError, ValueError) as error:  # too long a name, a loop of links, a character that no name can hold
        raise InputError(f"{entry.where}: file_path names no file ({error})", "mend file_path") from error
    return path


def _unusable(photo: Path, entry: Entry, why: str) -> InputError:
    return InputError(f"{entry.where}: the photograph {photo} cannot be used ({why})", "copy it again, or take it out")
