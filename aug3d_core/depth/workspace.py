"""COLMAP's dense workspace: images and a sparse model at the size of the depth maps, and the lists that its tools read.

Layout of COLMAP 3.x and 4.x: images/, sparse/, stereo/patch-match.cfg, stereo/fusion.cfg, stereo/depth_maps|normal_maps/.

COLMAP's dense tools take the index of a pixel for its centre, where its cameras have that half a pixel further right and down
(https://github.com/colmap/colmap/issues/1515). So the model here is one of indices: in it, pixel centres are whole numbers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Int
from PIL import Image

from aug3d_core.depth.cameras import camera_of
from aug3d_core.depth.files import WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS, geometric_map_name
from aug3d_core.geometry.area_mean import shrunk
from aug3d_core.geometry.depth_maps import read_map, write_map
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.rows import Rows
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name

IMAGES, SPARSE = "images", "sparse"
PATCH_MATCH_LIST, FUSION_LIST = "stereo/patch-match.cfg", "stereo/fusion.cfg"


def write_workspace(
    folder: Path,
    views: Views,
    sizes: Int[np.ndarray, "n 2"],
    points: Points,
    tracks: Tracks,
    photos: Path,
    masks: Path,
    chosen: list[int],
) -> None:
    """Write images, black where they are masked, and sparse model of the chosen views, and empty folders for their maps."""
    for name in (
        IMAGES,
        SPARSE,
        WORKSPACE_DEPTH_MAPS,
        WORKSPACE_NORMAL_MAPS,
        "stereo/consistency_graphs",
    ):
        (folder / name).mkdir(parents=True, exist_ok=True)  # a killed try may have left them, with maps
    for view in chosen:
        name, (width, height) = image_name(views.photo_id[view]), sizes[view].tolist()
        with Image.open(photos / name) as image:
            small = shrunk(np.asarray(image.convert("RGB")), (width, height))
        used = used_pixels(masks / name, (width, height))
        if used is not None:
            small[~used] = 0
        Image.fromarray(small).save(folder / IMAGES / name, compress_level=1)
    sparse_model(views, sizes, points, tracks, chosen).write(folder / SPARSE)


def sparse_model(
    views: Views, sizes: Int[np.ndarray, "n 2"], points: Points, tracks: Tracks, chosen: list[int]
) -> pycolmap.Reconstruction:
    """Return the chosen views (image id: view + 1) and the points that two or more of them see, in array indices of `sizes`."""
    model = pycolmap.Reconstruction()
    kept = np.isin(tracks.view, chosen)
    kept &= np.bincount(tracks.point[kept], minlength=len(points.xyz))[tracks.point] >= 2
    scale, by_view = sizes / views.size, Rows(tracks.view, len(views))
    index = np.zeros(len(kept), int)  # of each observation among those of its image
    for view in chosen:
        camera, rows = camera_of(views, view, sizes[view]), by_view.having(np.array([view]))
        rows = rows[kept[rows]]
        index[rows] = np.arange(len(rows))
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(
                model="PINHOLE",
                width=camera.width,
                height=camera.height,
                params=camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]],
                camera_id=view + 1,
            )
        )
        image = pycolmap.Image(
            name=image_name(views.photo_id[view]),
            keypoints=tracks.xy[rows] * scale[view] - 0.5,
            camera_id=view + 1,
            image_id=view + 1,
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(views.cam_from_world[view]))
    rows = np.flatnonzero(kept)
    rows = rows[np.argsort(tracks.point[rows], kind="stable")]
    for seen in np.split(rows, np.flatnonzero(np.diff(tracks.point[rows])) + 1):
        if len(seen):
            track = pycolmap.Track()
            for row in seen.tolist():
                track.add_element(int(tracks.view[row]) + 1, int(index[row]))
            point = tracks.point[seen[0]]
            model.add_point3D(points.xyz[point], track, points.rgb[point])
    return model


def mask_maps(folder: Path, views: Views, masks: Path, chosen: list[int]) -> None:
    """Take what is masked out of the depth and normal maps of the chosen views."""
    for view in chosen:
        name = geometric_map_name(views.photo_id[view])
        depth = read_map(folder / WORKSPACE_DEPTH_MAPS / name)
        used = used_pixels(masks / image_name(views.photo_id[view]), depth.shape[::-1])
        if used is not None:
            normals = read_map(folder / WORKSPACE_NORMAL_MAPS / name)
            write_map(folder / WORKSPACE_DEPTH_MAPS / name, np.where(used, depth, np.float32(0)))
            write_map(folder / WORKSPACE_NORMAL_MAPS / name, np.where(used[..., None], normals, np.float32(0)))


def write_patch_match_list(folder: Path, views: Views, sources: dict[int, list[int]]) -> None:
    """List for COLMAP's patch-match the sources of each view that has some."""
    lines = []
    for view, chosen in sources.items():
        if chosen:
            names = (image_name(views.photo_id[source]) for source in chosen)
            lines += [image_name(views.photo_id[view]), ", ".join(names)]
    (folder / PATCH_MATCH_LIST).write_text("\n".join(lines) + "\n")


def write_fusion_list(folder: Path, views: Views, chosen: list[int]) -> None:
    """List for COLMAP's fusion the views whose maps it reads."""
    (folder / FUSION_LIST).write_text("".join(f"{image_name(views.photo_id[view])}\n" for view in chosen))
