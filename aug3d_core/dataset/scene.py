"""The packed scene in memory, and what must hold of it.

Real views come first, in the order of sfm's Views, so that a real view's row is its index there; rendered views follow.
Depths and `near_far` are distances along the camera's z, in world units; a depth is 0 where unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Float16, Int, UInt8
from PIL import Image

from aug3d_core.dataset.by_view import ByView, OnDemand
from aug3d_core.dataset.slab import Slab
from aug3d_core.run.errors import InputError

# In memory, or read or made view by view: whoever indexes them need not know
if TYPE_CHECKING:
    Pictures = np.ndarray
else:
    Pictures = np.ndarray | ByView

REAL, RENDERED = 0, 1
FINER = 2
LEAST_SHOWN = 128  # alpha from which a pixel counts
# `splits` holds an index into these; rendered views are all `train`
SPLITS = ("train", "gap", "support", "target", "spare")


@dataclass(frozen=True)
class Scene:
    """All views of one scene, its groups, and the mesh render at the test targets."""

    images: UInt8[Pictures, "n h w 3"]
    fine_images: UInt8[Pictures, "n h2 w2 3"]  # the same, FINER times as wide and high; 0 of views that have none
    alpha: UInt8[Pictures, "n h w"]
    depth: Float16[Pictures, "n h w"]  # exact of renders, by stereo of training photographs
    scaffold: Float16[Pictures, "n h w"]  # of a mesh that was made without the test's targets
    world_from_cam: Float[np.ndarray, "n 4 4"]
    intrinsics: Float[np.ndarray, "n 4"]  # fx, fy, cx, cy in px
    near_far: Float[np.ndarray, "n 2"]
    source: UInt8[np.ndarray, " n"]  # REAL or RENDERED
    photo_id: Int[np.ndarray, " n"]  # -1 for rendered views
    dome_id: Int[np.ndarray, " n"]  # -1 for real views
    splits: UInt8[np.ndarray, " n"]  # index into SPLITS
    groups: dict[str, Int[np.ndarray, "c k"]]  # "real", "rendered": for training; "test": a target first, then inputs
    baseline_view: Int[np.ndarray, " t"]  # the target that the render beside it shows
    baseline_images: UInt8[np.ndarray, "t h w 3"]
    baseline_alpha: UInt8[np.ndarray, "t h w"]
    slab: Slab
    scale: float  # median distance along z from a camera to the ground, world units
    attributes: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.images)

    def used(self, view: int) -> Bool[np.ndarray, "h w"] | None:
        """Return which pixels of a view show something that may be used; None if all do."""
        shown = self.alpha[view] >= LEAST_SHOWN
        return None if shown.all() else shown

    def fine(self, views: Int[np.ndarray, " v"]) -> UInt8[np.ndarray, "v h2 w2 3"]:
        """Return the fine images of some views; of those that have none, their images enlarged."""
        found = np.array(self.fine_images[views])
        for row, view in enumerate(views):
            if not found[row].any():
                found[row] = enlarged(self.images[view])
        return found

    @property
    def height_px(self) -> int:
        """Height of every view."""
        return self.images.shape[1]

    @property
    def width_px(self) -> int:
        """Width of every view."""
        return self.images.shape[2]


PICTURES = ("images", "fine_images", "alpha", "depth", "scaffold")  # of every view; all else of a scene is small
VIEW_ARRAYS = (
    *PICTURES,
    "world_from_cam",
    "intrinsics",
    "near_far",
    "source",
    "photo_id",
    "dome_id",
    "splits",
)
BASELINE_ARRAYS = ("baseline_view", "baseline_images", "baseline_alpha")
GROUPS = ("real", "rendered", "test")


def enlarged(image: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h2 w2 3"]:
    """Return an image FINER times as wide and high, between whose pixels it is smooth."""
    height, width = image.shape[:2]
    size = (FINER * width, FINER * height)
    return np.asarray(Image.fromarray(np.ascontiguousarray(image)).resize(size, Image.Resampling.BILINEAR))


def no_fine_images(count: int, size_px: tuple[int, int]) -> Any:
    """Return the fine images of so many views, of a size (width, height), that have none."""
    nothing = np.zeros((FINER * size_px[1], FINER * size_px[0], 3), np.uint8)
    return OnDemand(count, nothing.shape, np.uint8, lambda _: nothing)


def check(scene: Scene, name: str) -> Scene:
    """Return the scene if it can be used; raise InputError with the view or group at fault otherwise."""
    again = "pack the scene again (stage dataset)"
    for array in VIEW_ARRAYS:
        if len(getattr(scene, array)) != len(scene):
            raise InputError(f"{name}: {array} has {len(getattr(scene, array))} rows for {len(scene)} views", again)
    fine = (len(scene), FINER * scene.height_px, FINER * scene.width_px, 3)
    if scene.fine_images.shape != fine:
        raise InputError(f"{name}: fine_images has the shape {scene.fine_images.shape}, not {fine}", again)
    near, far = scene.near_far.T
    if not np.all((near > 0) & (near < far) & np.isfinite(far)):
        view = int(np.flatnonzero(~((near > 0) & (near < far) & np.isfinite(far)))[0])
        raise InputError(f"{name}: view {view} has near {near[view]:g} and far {far[view]:g}", again)
    for array in ("world_from_cam", "intrinsics"):
        values = getattr(scene, array).reshape(len(scene), -1)
        if not np.isfinite(values).all():
            view = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            raise InputError(f"{name}: {array} of view {view} is not finite", again)
    if not scene.slab.low < scene.slab.high:
        raise InputError(f"{name}: the slab's low {scene.slab.low:g} is not below its high {scene.slab.high:g}", again)
    for group, members in scene.groups.items():
        if members.size and not (members.min() >= 0 and members.max() < len(scene)):
            raise InputError(f"{name}: groups/{group} names a view beyond the {len(scene)} there are", again)
    bare = np.setdiff1d(scene.groups["test"][:, :1], scene.baseline_view)
    if len(bare):
        raise InputError(f"{name}: test view {bare[0]} has no mesh render beside it", again)
    return scene
