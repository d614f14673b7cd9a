"""A view that no photograph shows: which photographs it is predicted from, where it stands, whether it can be seen from them.

The view becomes one more row of the packed scene, without pixels, so that it is predicted as a held-out photograph is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.dataset.new_views import facing, shown_by_none, with_scaffold, with_views
from aug3d_core.dataset.projection import ground_points, middle_ground, shows
from aug3d_core.dataset.scene import REAL, Scene
from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.inputs import inputs_of, most_alike
from aug3d_core.run.errors import InputError


@dataclass(frozen=True)
class NovelView:
    """The scene with the view as its last row, the rows of its inputs, and the share of its pixels whose ground they show."""

    scene: Scene
    target: int
    inputs: Int[np.ndarray, " v"]
    ground_seen_share: float


def novel_view(scene: Scene, config: PredictionConfig) -> NovelView:
    """Choose what the configuration leaves open: inputs that show the view, or a view amid the inputs.

    Raises InputError if a photograph is not in the scene, or if the inputs show nothing of the view's ground.
    """
    photos = np.flatnonzero((scene.source == REAL) & (scene.photo_id != (-1 if config.like is None else config.like)))
    if not len(photos):
        raise InputError("no photograph is left to predict from", "give at least one beside the photograph of like")
    inputs = np.array([row_of(scene, photo_id) for photo_id in config.inputs], int)
    if config.like is not None:
        like = row_of(scene, config.like)
        pose, intrinsics = scene.world_from_cam[like], scene.intrinsics[like]
    else:
        intrinsics = np.median(scene.intrinsics[photos], axis=0)
        if config.at is not None and config.look_at is not None:
            pose = homogeneous(invert(look_at(np.array(config.at), np.array(config.look_at))))
        else:
            inputs = inputs if len(inputs) else central(scene, photos)[: config.input_views]
            pose = amid(scene, inputs)
    _check_above_ground(scene, pose)
    seen_from = inputs if len(inputs) else photos
    wider, (target,) = with_views(scene, pose[None], intrinsics, seen_from)
    inputs = inputs if len(inputs) else inputs_of(wider, int(target), photos, config.input_views)
    wider = with_scaffold(wider, np.array([target]), inputs)
    return NovelView(wider, int(target), inputs, _ground_seen_share(wider, target, inputs))


def row_of(scene: Scene, photo_id: int) -> int:
    """Return a photograph's row; raises InputError if the scene has no such photograph."""
    rows = np.flatnonzero(scene.photo_id == photo_id)
    if photo_id < 0 or not len(rows):
        known = scene.photo_id[scene.source == REAL]
        raise InputError(
            f"photo {photo_id} is not in the packed scene",
            f"it holds {len(known)} photographs, numbered {known.min()} to {known.max()}; some may have found no place",
        )
    return int(rows[0])


def central(scene: Scene, photos: Int[np.ndarray, " p"]) -> Int[np.ndarray, " p"]:
    """Order photographs from the one that looks at the middle of the scene, by what they show alike with it."""
    spots = np.stack([middle_ground(scene, int(view)) for view in photos])
    first = photos[np.argmin(np.linalg.norm(spots - np.median(spots, axis=0), axis=1))]
    return np.append(first, most_alike(scene, int(first), photos[photos != first]))


def amid(scene: Scene, inputs: Int[np.ndarray, " v"]) -> Float[np.ndarray, "4 4"]:
    """Return the pose in the middle of some cameras, that looks at the middle of what they look at.

    A single camera has none but its own middle: it is then moved by a tenth of its distance to the ground.
    """
    eye = scene.world_from_cam[inputs, :3, 3].mean(axis=0)
    spot = np.mean([middle_ground(scene, int(view)) for view in inputs], axis=0)
    right, down = scene.world_from_cam[inputs[0], :3, :2].T
    if len(inputs) == 1:
        eye = eye + 0.1 * np.linalg.norm(spot - eye) * right
    return facing(eye, spot, -down)


def _check_above_ground(scene: Scene, pose: Float[np.ndarray, "4 4"]) -> None:
    height = float(scene.slab.height(pose[:3, 3]))
    if height <= 0:
        where = ", ".join(f"{value:.4g}" for value in pose[:3, 3])
        raise InputError(
            f"the camera at {where} stands {-height:.4g} below the ground",
            f"raise it: the ground there is at z = {pose[2, 3] - height:.4g}",
        )


def _ground_seen_share(scene: Scene, target: int, inputs: np.ndarray) -> float:
    """Return the share of a view's pixels whose ground some input shows; raises InputError if there is none."""
    ground, reached = ground_points(scene, target)
    seen = reached & np.any([shows(scene, int(view), ground) for view in inputs], axis=0)
    if not seen.any():
        raise shown_by_none(scene, inputs)
    return float(seen.mean())
