"""The layouts of nerfstudio and COLMAP: a folder for each sequence, which most tools for one scene read."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.export.colmap_text import write_model
from aug3d_core.export.taken import DEPTH, IMAGES, MASKS, Taken
from aug3d_core.geometry.camera_models import world_from_gl
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.poses.recognise import TRANSFORMS

_USUAL = 0.001  # nerfstudio multiplies depth, in 16 bit whole numbers, by this, whatever transforms.json says
_MOST = 65_535
README = "README.txt"
_TOLD = """\
Depth is in whole numbers of {unit} world units, which nerfstudio does not take from transforms.json. Tell it:

ns-train depth-nerfacto nerfstudio-data --data SEQUENCE --depth-unit-scale-factor {unit}
"""


def write_nerfstudio(taken: Sequence[Taken], folder: Path) -> None:
    """Write sequences, each in a folder of its part; depth in thousandths of a world unit, or coarser where it would not fit.

    All have one unit: nerfstudio is told it on its command line, as the file README says. If a view of a sequence has a hole or
    is masked, all its views have masks, 0 where nerfstudio is not to train.
    """
    deepest = [float(np.asarray(one.scene.depth[one.rows], np.float32).max()) for one in taken]
    unit = max(_USUAL, max(deepest, default=0.0) / _MOST)
    if any(deepest):
        (folder / README).write_text(_TOLD.format(unit=unit))
    for one, deep in zip(taken, deepest, strict=True):
        own = folder / one.part / one.key
        holes = bool((one.scene.alpha[one.rows] < 255).any())
        poses = homogeneous(world_from_gl(invert(one.scene.world_from_cam[one.rows][:, :3])))
        frames = []
        for name, view, pose in zip(one.write_images(own), one.rows.tolist(), poses, strict=True):
            fl_x, fl_y, cx, cy = one.intrinsics(view).tolist()
            frame = {
                "file_path": name,
                "transform_matrix": pose.tolist(),
                "fl_x": fl_x,
                "fl_y": fl_y,
                "cx": cx,
                "cy": cy,
            }
            if deep:
                frame["depth_file_path"] = f"{DEPTH}/{Path(name).name}"
                (own / DEPTH).mkdir(exist_ok=True)
                whole = np.rint(one.depth(view) / unit).astype(np.uint16)
                Image.fromarray(whole).save(own / frame["depth_file_path"])
            if holes:
                frame["mask_path"] = f"{MASKS}/{Path(name).name}"
                (own / MASKS).mkdir(exist_ok=True)
                Image.fromarray(one.mask(view)).save(own / frame["mask_path"])
            frames.append(frame)
        size = {"w": one.fit.width_px, "h": one.fit.height_px}
        scale = {"depth_unit_scale_factor": unit} if deep else {}
        told = {"camera_model": "OPENCV", **size, **scale, "frames": frames}
        (own / TRANSFORMS).write_text(json.dumps(told, indent=1))


def write_colmap(taken: Sequence[Taken], folder: Path) -> None:
    """Write sequences, each in a folder of its part: cameras and poses, without points."""
    none = np.zeros(0, int)
    for one in taken:
        own, count = folder / one.part / one.key, len(one.rows)
        names = [Path(name).relative_to(IMAGES).as_posix() for name in one.write_images(own)]
        views = Views(
            np.arange(count),
            invert(one.scene.world_from_cam[one.rows][:, :3]),
            np.stack([one.intrinsics(int(view)) for view in one.rows]),
            np.tile([one.fit.width_px, one.fit.height_px], (count, 1)),
        )
        points = Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
        write_model(views, points, Tracks(none, none, np.zeros((0, 2))), names, own / "sparse" / "0")
