"""Photo, depth and normals side by side, for people to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image

from aug3d_core.depth.files import DEPTH_MAPS, DEPTH_SHEET, NORMAL_MAPS, geometric_map_name
from aug3d_core.geometry.depth_maps import read_map
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name

_HOLE = 128
_GAP_PX = 6
_WIDTH_PX = 480
# Viridis (matplotlib, CC0) at nine even steps: equal steps in depth look equal, also in grey
_VIRIDIS = np.array(
    [
        [68, 1, 84],
        [72, 40, 120],
        [62, 74, 137],
        [49, 104, 142],
        [38, 130, 142],
        [31, 158, 137],
        [53, 183, 121],
        [110, 206, 88],
        [253, 231, 37],
    ],
    float,
)


def depth_picture(depth: Float32[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return near as yellow and far as violet, between the 2nd and 98th percentile; holes are grey."""
    picture = np.full((*depth.shape, 3), _HOLE, np.uint8)
    known = depth > 0
    if known.any():
        near, far = np.percentile(depth[known], [2, 98])
        place = np.clip((far - depth[known]) / max(far - near, 1e-9), 0, 1) * (len(_VIRIDIS) - 1)
        steps = np.arange(len(_VIRIDIS))
        picture[known] = np.stack([np.interp(place, steps, _VIRIDIS[:, c]) for c in range(3)], axis=-1)
    return picture


def normal_picture(normal: Float32[np.ndarray, "h w 3"], cam_from_world: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    """Return east as red, north as green, up as blue (half bright at 0); holes are grey."""
    in_world = normal @ cam_from_world[:, :3]
    picture = np.rint(127.5 * (in_world + 1)).clip(0, 255).astype(np.uint8)
    picture[~normal.any(axis=-1)] = _HOLE
    return picture


def draw_sheet(out: Path, images: Path, views: Views, chosen: list[int]) -> None:
    """Draw one row per view: photo, depth, normals."""
    rows = []
    for view in chosen:
        name = geometric_map_name(views.photo_id[view])
        depth, normal = read_map(out / DEPTH_MAPS / name), read_map(out / NORMAL_MAPS / name)
        with Image.open(images / image_name(views.photo_id[view])) as image:
            photo = image.convert("RGB")
        pictures = (depth_picture(depth), normal_picture(normal, views.cam_from_world[view]))
        size = (_WIDTH_PX, round(_WIDTH_PX * depth.shape[0] / depth.shape[1]))
        rows.append([picture.resize(size) for picture in (photo, *map(Image.fromarray, pictures))])
    height = sum(row[0].height + _GAP_PX for row in rows) - _GAP_PX
    sheet = Image.new("RGB", (3 * (_WIDTH_PX + _GAP_PX) - _GAP_PX, height), (255, 255, 255))
    top = 0
    for row in rows:
        for column, picture in enumerate(row):
            sheet.paste(picture, (column * (_WIDTH_PX + _GAP_PX), top))
        top += row[0].height + _GAP_PX
    sheet.save(out / DEPTH_SHEET)
