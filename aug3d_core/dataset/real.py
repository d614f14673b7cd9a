"""Photographs -> packed views."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, Float16, UInt8
from PIL import Image

from aug3d_core.dataset.bounds import depths_in, near_far
from aug3d_core.dataset.by_view import OnDemand
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.images import Fit, fit
from aug3d_core.dataset.scene import FINER, SPLITS
from aug3d_core.dataset.slab import Slab
from aug3d_core.depth.files import DEPTH_MAPS, geometric_map_name
from aug3d_core.geometry.depth_maps import read_map
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.rows import Rows
from aug3d_core.geometry.transforms import apply, homogeneous, invert
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import SPLIT_TABLE


@dataclass(frozen=True)
class RealViews:
    """The photographs of a scene at packed size; rows as in sfm's Views."""

    images: UInt8[OnDemand, "n h w 3"]
    fine_images: UInt8[OnDemand, "n h2 w2 3"]
    alpha: UInt8[OnDemand, "n h w"]  # 0 where masked
    depth: Float16[OnDemand, "n h w"]  # by stereo, of training photographs; 0 where it is not sure
    world_from_cam: Float[np.ndarray, "n 4 4"]
    intrinsics: Float[np.ndarray, "n 4"]
    near_far: Float[np.ndarray, "n 2"]
    splits: UInt8[np.ndarray, " n"]
    kept_share: float  # of the pixels of the view cropped most
    enlarged: float  # packed pixels along one of the smallest photograph


def pack_real(sfm: Path, grouping: Path, depth: Path, slab: Slab, config: DatasetConfig) -> RealViews:
    """Measure the bounds of every registered photograph; it is shrunk to packed size when it is asked for."""
    views, points = Views.load(sfm / VIEWS), Points.load(sfm / POINTS)
    tracks = Tracks.load(sfm / TRACKS)
    size = (config.width_px, config.height_px)
    fits = [fit(int(w), int(h), *size) for w, h in views.size]
    world_from_cam = homogeneous(invert(views.cam_from_world))
    intrinsics = np.array([f.intrinsics(k) for f, k in zip(fits, views.intrinsics, strict=True)])
    images, fine_images, alpha = packed_pictures(sfm, views, fits)
    bounds = [
        near_far(slab, pose, lens, size, depths)
        for pose, lens, depths in zip(world_from_cam, intrinsics, seen_depths(views, points, tracks), strict=True)
    ]
    splits = read_splits(grouping / SPLIT_TABLE, views)
    train = splits == SPLITS.index("train")

    def stereo(view: int) -> Float16[np.ndarray, "h w"]:
        if not train[view]:
            return np.zeros(size[::-1], np.float16)
        return np.where(alpha[view] > 0, _stereo(depth, int(views.photo_id[view]), config), np.float16(0))

    return RealViews(
        images,
        fine_images,
        alpha,
        OnDemand(len(views), size[::-1], np.float16, stereo),
        world_from_cam,
        intrinsics,
        np.array(bounds),
        splits,
        min(f.kept_share for f in fits),
        max(f.enlarged for f in fits),
    )


def read_splits(path: Path, views: Views) -> UInt8[np.ndarray, " n"]:
    """Return each view's role as an index into SPLITS; views that the table leaves out are an error."""
    table = pd.read_parquet(path).sort_values("view")
    if not np.array_equal(table["view"], np.arange(len(views))):
        raise InputError(f"{path.name} has {len(table)} rows for {len(views)} views", "run the stage grouping again")
    return np.array([SPLITS.index(role) for role in table["role"]], np.uint8)


def packed_pictures(sfm: Path, views: Views, fits: list[Fit]) -> tuple[OnDemand, OnDemand, OnDemand]:
    """Return images, fine images and alpha of photographs, each read when it is asked for; `fits` has the crop of each.

    Raises InputError with the photographs of which their masks leave nothing.
    """
    photo_id, count, size = views.photo_id.tolist(), len(views), (fits[0].height_px, fits[0].width_px)
    alpha = OnDemand(count, size, np.uint8, lambda i: packed_alpha(sfm, photo_id[i], fits[i]))
    bare = [str(photo) for i, photo in enumerate(photo_id) if not alpha[i].any()]
    if bare:
        raise InputError(
            f"masks leave nothing of {len(bare)} photos as they are packed, {size[1]}x{size[0]} px: {', '.join(bare)}",
            "mend the masks, or take the photographs out",
        )

    def colours(times: int) -> OnDemand:
        at = [one.times(times) for one in fits]
        shape = (times * size[0], times * size[1], 3)
        return OnDemand(count, shape, np.uint8, lambda i: packed_colour(sfm, photo_id[i], at[i]))

    return colours(1), colours(FINER), alpha


def packed_colour(sfm: Path, photo_id: int, crop: Fit) -> UInt8[np.ndarray, "h w 3"]:
    """Return a photograph at packed size, without what is masked."""
    with Image.open(sfm / VIEW_IMAGES / image_name(photo_id)) as image:
        rgb = np.asarray(image.convert("RGB"))
    used = used_pixels(sfm / VIEW_MASKS / image_name(photo_id))
    return crop.colour(rgb) if used is None else crop.masked(rgb, used)


def packed_alpha(sfm: Path, photo_id: int, crop: Fit) -> UInt8[np.ndarray, "h w"]:
    """Return 0 where a photograph is masked, 255 elsewhere."""
    used = used_pixels(sfm / VIEW_MASKS / image_name(photo_id))
    if used is None:
        return np.full((crop.height_px, crop.width_px), 255, np.uint8)
    return crop.alpha(used)


def _stereo(depth: Path, photo_id: int, config: DatasetConfig) -> Float16[np.ndarray, "h w"]:
    """Return the depth that other photographs confirm: the nearest pixel's, as a mean over an edge lies in the air."""
    path = depth / DEPTH_MAPS / geometric_map_name(photo_id)
    if not path.is_file():
        return np.zeros((config.height_px, config.width_px), np.float16)
    values = read_map(path)
    return fit(values.shape[1], values.shape[0], config.width_px, config.height_px).nearest(values).astype(np.float16)


def seen_depths(views: Views, points: Points, tracks: Tracks) -> Iterator[Float[np.ndarray, " s"]]:
    """Yield for each view the depths of the points that it is known to see; of all points before it where there are none.

    Of a view that has no point before it, the distances to all points.
    """
    by_view = Rows(tracks.view, len(views))
    for view, pose in enumerate(views.cam_from_world):
        depths = depths_in(pose, points.xyz[tracks.point[by_view.having(np.array([view]))]])
        if not len(depths):
            depths = depths_in(pose, points.xyz)
        yield depths if len(depths) else np.linalg.norm(apply(pose, points.xyz), axis=1)
