"""Views without pixels, added to a scene so that they are predicted as held-out photographs are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import grey_opening

from aug3d_core.dataset.bounds import depths_in, near_far
from aug3d_core.dataset.by_view import changed, joined
from aug3d_core.dataset.projection import project, sampled_ground, shows
from aug3d_core.dataset.rays import pixel_rays
from aug3d_core.dataset.scene import BASELINE_ARRAYS, PICTURES, REAL, SPLITS, VIEW_ARRAYS, Scene
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.run.errors import InputError

_NAMED = 5  # photographs, in an error


def with_views(
    scene: Scene,
    world_from_cam: Float[np.ndarray, "f 4 4"],
    intrinsics: Float[np.ndarray, " 4"],
    inputs: Int[np.ndarray, " v"],
) -> tuple[Scene, Int[np.ndarray, " f"]]:
    """Append views without pixels, and return their rows; near and far hold what the inputs show of the ground ahead."""
    ground = sampled_ground(scene, inputs)
    size_px, count = (scene.width_px, scene.height_px), len(world_from_cam)
    bounds = []
    for pose in world_from_cam:
        depths = depths_in(invert(pose[:3]), ground)
        if not len(depths):
            raise shown_by_none(scene, inputs)
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
        if name in PICTURES:
            longer[name] = joined(array, np.zeros((count, *array.shape[1:]), array.dtype))
        else:
            longer[name] = np.concatenate([array, known[name].astype(array.dtype)])
    return replace(scene, **longer), len(scene) + np.arange(count)


def with_scaffold(scene: Scene, rows: Int[np.ndarray, " f"], inputs: Int[np.ndarray, " v"]) -> Scene:
    """Give views a scaffold: what the scaffolds of their inputs show, seen from there; 0 where none shows anything.

    Each pixel of an input is one point. Gaps between points, one or two pixels wide, are closed with what lies nearest.
    """
    found = {}
    points = np.concatenate([_scaffold_points(scene, int(view)) for view in inputs])
    for row in rows:
        depth = np.full((scene.height_px, scene.width_px), np.inf)
        shown = points[shows(scene, int(row), points)]
        x, y = np.minimum(project(scene, int(row), shown)[0], [scene.width_px - 1, scene.height_px - 1]).astype(int).T
        along = (shown - scene.world_from_cam[row, :3, 3]) @ scene.world_from_cam[row, :3, 2]
        np.minimum.at(depth, (y, x), along)
        closed = grey_opening(depth, size=3)
        found[int(row)] = np.where(np.isfinite(closed), closed, 0).astype(scene.scaffold.dtype)
    return replace(scene, scaffold=changed(scene.scaffold, found))


def _scaffold_points(scene: Scene, view: int) -> Float[np.ndarray, "p 3"]:
    """Return the point of each pixel of a view that has a scaffold."""
    y, x = np.nonzero(scene.scaffold[view])
    rays = pixel_rays(scene, np.full(len(x), view), np.stack([x, y], axis=1) + 0.5, slab_bounds=False)
    depth = scene.scaffold[view, y, x].astype(float)
    return rays.origins + depth[:, None] * rays.directions


def only(scene: Scene, views: Int[np.ndarray, " v"]) -> Scene:
    """Return the scene with some of its views alone, and no groups."""
    kept = {name: getattr(scene, name)[views] for name in VIEW_ARRAYS}
    bare = {name: getattr(scene, name)[:0] for name in BASELINE_ARRAYS}
    return replace(scene, **kept, **bare, groups={name: members[:0] for name, members in scene.groups.items()})


def facing(
    eye: Float[np.ndarray, " 3"], spot: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """Return the `world_from_cam` of a camera that looks at a spot with `up` (not along its view) towards its top."""
    z = (spot - eye) / np.linalg.norm(spot - eye)
    x = np.cross(z, up)
    x = x / np.linalg.norm(x)
    return homogeneous(np.stack([x, np.cross(z, x), z, eye], axis=1))


def shown_by_none(scene: Scene, inputs: np.ndarray) -> InputError:
    """Return the error of a view that shows nothing of what its inputs show."""
    ids = ", ".join(str(photo_id) for photo_id in scene.photo_id[inputs[:_NAMED]])
    more = f" and {len(inputs) - _NAMED} more" if len(inputs) > _NAMED else ""
    return InputError(
        f"the view shows no ground that its inputs show (photos {ids}{more})",
        "move or turn the view towards what they show; if you named the inputs, name some that look at the same place",
    )
