"""Posed photographs from outside a scene -> a scene of their own, for a model that was trained elsewhere.

They come as a nerfstudio `transforms.json`. Where it names a point cloud (`ply_file_path`, as `aug3d export` writes it), the
ground is measured there; else the poses must be in the world of the scene that the model was trained on, and its ground is
taken.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from aug3d_core.dataset.bounds import depths_in, near_far
from aug3d_core.dataset.photographs import usual_slab
from aug3d_core.dataset.scale import ground_distance
from aug3d_core.dataset.scene import BASELINE_ARRAYS, REAL, SPLITS, Scene
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.novel.posed import posed, posed_digest
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.picture import decoding_budget
from aug3d_core.run.regular_file import MOST_TEXT_BYTES, content, json_content

_NO_CLOUD = "take ply_file_path out if the poses are in the world of the scene, else give points as aug3d writes them"


def photo_names(file: Path) -> pd.DataFrame:
    """Return the photographs that pose files name, numbered in their order: `photo_id`, `name`."""
    names = [entry.names[0][0].removeprefix("./") for entry in read_transforms(file)]
    return pd.DataFrame({"photo_id": range(len(names)), "name": names})


def photos_digest(file: Path) -> str:
    """Digest of the poses and of every photograph, mask and point cloud that they name; raises InputError if one is missing."""
    digest = hashlib.sha256(content(file, MOST_TEXT_BYTES))
    for entry in read_transforms(file):
        digest.update(posed_digest(file, entry).encode())
    cloud = json_content(file).get("ply_file_path")
    if cloud is not None:
        try:
            digest.update(file_digest(_cloud_file(file, cloud)).encode())
        except (OSError, ValueError) as error:
            raise _unreadable(file, cloud, error) from error
    return digest.hexdigest()


def outside_scene(file: Path, trained_on: Scene) -> Scene:
    """Return the photographs at the size that the model knows, over their ground.

    Raises InputError for a photograph, a mask or a point cloud that cannot be used.
    """
    entries = read_transforms(file)
    size_px = (trained_on.width_px, trained_on.height_px)
    slab, points = _ground(file, trained_on.slab)
    photos, bounds, budget = [], [], decoding_budget()
    poses = homogeneous(invert(np.stack([entry.cam_from_world for entry in entries])))
    for entry, pose in zip(entries, poses, strict=True):
        photo = posed(file, entry, size_px, budget)
        seen = depths_in(entry.cam_from_world, points) if points is not None else np.zeros(0)
        height = abs(float(slab.height(pose[:3, 3])))
        seen = seen if len(seen) else np.array([height, 2 * height])
        photos.append(photo)
        bounds.append(near_far(slab, pose, photo.intrinsics, size_px, seen))
    count, unknown = len(entries), np.zeros((len(entries), *size_px[::-1]), np.float16)
    scene = replace(
        trained_on,
        images=np.stack([photo.image for photo in photos]),
        fine_images=np.stack([photo.fine_image for photo in photos]),
        alpha=np.stack([photo.alpha for photo in photos]),
        depth=unknown,
        scaffold=unknown,
        world_from_cam=poses,
        intrinsics=np.stack([photo.intrinsics for photo in photos]),
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
    return replace(scene, scale=ground_distance(slab, poses, scene.intrinsics, scene.near_far, size_px))


def _ground(file: Path, otherwise: Slab) -> tuple[Slab, np.ndarray | None]:
    cloud = json_content(file).get("ply_file_path")
    if cloud is None:
        return otherwise, None
    try:
        points = Mesh.load(_cloud_file(file, cloud)).xyz.astype(float)
    except (OSError, ValueError) as error:
        raise _unreadable(file, cloud, error) from error
    if not len(points) or not np.isfinite(points).all():
        raise InputError(
            f"{file.name}: the point cloud {cloud} holds no points, or some that are not finite", _NO_CLOUD
        )
    return usual_slab(points), points


def _cloud_file(file: Path, named: Any) -> Path:
    if not isinstance(named, str):
        raise ValueError("it is no text")
    return file.parent / named


def _unreadable(file: Path, cloud: Any, error: Exception) -> InputError:
    return InputError(f"{file.name}: the point cloud {cloud} cannot be read ({error})", _NO_CLOUD)
