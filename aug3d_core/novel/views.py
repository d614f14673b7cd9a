"""A view that no photograph shows: which photographs it is predicted from, where it stands, whether it can be seen from them.

The view becomes one more row of the packed scene, without pixels, so that it is predicted as a held-out photograph is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.dataset.bounds import depths_in, near_far
from aug3d_core.dataset.rays import pixel_rays
from aug3d_core.dataset.scene import BASELINE_ARRAYS, REAL, SPLITS, VIEW_ARRAYS, Scene
from aug3d_core.geometry.transforms import homogeneous, invert, look_at
from aug3d_core.heads.pixelnerf.config import PredictionConfig
from aug3d_core.judging.cheap_answers import ground_points, project
from aug3d_core.run.errors import InputError


@dataclass(frozen=True)
class NovelView:
    """The scene with the view as its last row, the rows of its inputs, and the share of its pixels whose ground they show."""

    scene: Scene
    target: int
    inputs: Int[np.ndarray, " v"]
    ground_seen_share: float


def novel_view(scene: Scene, config: PredictionConfig) -> NovelView:
    """Choose what the configuration leaves open: inputs near the view, or a view amid the inputs.

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
    inputs = inputs if len(inputs) else most_alike(wider, target, photos)[: config.input_views]
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


def with_views(
    scene: Scene,
    world_from_cam: Float[np.ndarray, "f 4 4"],
    intrinsics: Float[np.ndarray, " 4"],
    inputs: Int[np.ndarray, " v"],
) -> tuple[Scene, Int[np.ndarray, " f"]]:
    """Append views without pixels, and return their rows; near and far hold what the inputs show of the ground ahead."""
    ground = np.concatenate([points[reached] for points, reached in (ground_points(scene, int(v)) for v in inputs)])
    size_px, count = (scene.width_px, scene.height_px), len(world_from_cam)
    bounds = []
    for pose in world_from_cam:
        depths = depths_in(invert(pose[:3]), ground)
        if not len(depths):
            raise _shown_by_none(scene, inputs)
        bounds.append(near_far(scene.slab, pose, intrinsics, size_px, depths))
    known = {
        "world_from_cam": world_from_cam,
        "intrinsics": np.tile(intrinsics, (count, 1)),
        "near_far": np.stack(bounds),
        "source": np.full(count, REAL),
        "photo_id": np.full(count, -1),
        "dome_id": np.full(count, -1),
        "splits": np.full(count, SPLITS.index("target")),
    }
    longer = {}
    for name in VIEW_ARRAYS:
        array = getattr(scene, name)
        rows = known[name] if name in known else np.zeros((count, *array.shape[1:]))
        longer[name] = np.concatenate([array, rows.astype(array.dtype)])
    return replace(scene, **longer), len(scene) + np.arange(count)


def only(scene: Scene, views: Int[np.ndarray, " v"]) -> Scene:
    """Return the scene with some of its views alone, and no groups."""
    kept = {name: getattr(scene, name)[views] for name in VIEW_ARRAYS}
    bare = {name: getattr(scene, name)[:0] for name in BASELINE_ARRAYS}
    return replace(scene, **kept, **bare, groups={name: members[:0] for name, members in scene.groups.items()})


def central(scene: Scene, photos: Int[np.ndarray, " p"]) -> Int[np.ndarray, " p"]:
    """Order photographs from the one that looks at the middle of the scene, by what they show alike with it."""
    spots = np.stack([middle_ground(scene, int(view)) for view in photos])
    first = photos[np.argmin(np.linalg.norm(spots - np.median(spots, axis=0), axis=1))]
    return np.append(first, most_alike(scene, int(first), photos[photos != first]))


def most_alike(scene: Scene, view: int, photos: Int[np.ndarray, " p"]) -> Int[np.ndarray, " p"]:
    """Order photographs by the share of a view's ground that they show, in whole percents; the nearer camera first."""
    ground, reached = ground_points(scene, view)
    percent = np.array([np.round(100 * (reached & _shows(scene, int(photo), ground)).mean()) for photo in photos])
    away = np.linalg.norm(scene.world_from_cam[photos, :3, 3] - scene.world_from_cam[view, :3, 3], axis=1)
    return photos[np.lexsort((away, -percent))]


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


def facing(
    eye: Float[np.ndarray, " 3"], spot: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """Return the `world_from_cam` of a camera that looks at a spot with `up` (not along its view) towards its top."""
    z = (spot - eye) / np.linalg.norm(spot - eye)
    x = np.cross(z, up)
    x = x / np.linalg.norm(x)
    return homogeneous(np.stack([x, np.cross(z, x), z, eye], axis=1))


def middle_ground(scene: Scene, view: int) -> Float[np.ndarray, " 3"]:
    """Return where the ray of an image's middle meets the ground, or a point ahead at the scene's usual distance."""
    middle = np.array([[scene.width_px / 2, scene.height_px / 2]])
    ray = pixel_rays(scene, np.array([view]), middle, slab_bounds=False)
    t = scene.slab.meet(ray.origins, ray.directions, 0.0)
    return (ray.origins + np.where(np.isfinite(t), t, scene.scale)[:, None] * ray.directions)[0]


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
    seen = reached & np.any([_shows(scene, int(view), ground) for view in inputs], axis=0)
    if not seen.any():
        raise _shown_by_none(scene, inputs)
    return float(seen.mean())


def _shown_by_none(scene: Scene, inputs: np.ndarray) -> InputError:
    ids = ", ".join(str(photo_id) for photo_id in scene.photo_id[inputs])
    return InputError(
        f"the view shows no ground that its inputs show (photos {ids})",
        "move or turn the view towards them, or choose inputs that look at the same place",
    )


def _shows(scene: Scene, view: int, points_in_world: Float[np.ndarray, "p 3"]) -> Bool[np.ndarray, " p"]:
    xy_px, ahead = project(scene, view, points_in_world)
    return ahead & ((xy_px >= 0) & (xy_px <= [scene.width_px, scene.height_px])).all(axis=1)
