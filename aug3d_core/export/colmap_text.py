"""Views, points and tracks -> a COLMAP model as text, which every version of COLMAP and related tools read.

Format: colmap.github.io/format.html. Numbers are written with full precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from aug3d_core.geometry.views import Points, Tracks, Views


def write_model(views: Views, points: Points, tracks: Tracks, names: Sequence[str], folder: Path) -> None:
    """Write cameras.txt, images.txt and points3D.txt; view i is image i + 1 with the name `names[i]`."""
    folder.mkdir(parents=True)
    kinds, camera = np.unique(np.concatenate([views.size, views.intrinsics], axis=1), axis=0, return_inverse=True)
    lines = [
        f"{number} PINHOLE {_row(map(int, kind[:2]))} {_row(kind[2:])}" for number, kind in enumerate(kinds, start=1)
    ]
    _write(folder / "cameras.txt", lines)
    # Observations are in order of points; within an image they are numbered in that order.
    by_view = np.argsort(tracks.view, kind="stable")
    firsts = np.searchsorted(tracks.view[by_view], np.arange(len(views) + 1))
    place = np.zeros(len(tracks.view), int)
    lines = []
    for index, (name, (start, end)) in enumerate(zip(names, pairwise(firsts), strict=True)):
        seen = by_view[start:end]
        place[seen] = np.arange(len(seen))
        quaternion = Rotation.from_matrix(views.cam_from_world[index, :, :3]).as_quat()[[3, 0, 1, 2]]
        pose = f"{_row(quaternion)} {_row(views.cam_from_world[index, :, 3])}"
        lines.append(f"{index + 1} {pose} {camera.ravel()[index] + 1} {name}")
        lines.append(" ".join(f"{_row(tracks.xy[i])} {tracks.point[i] + 1}" for i in seen))
    _write(folder / "images.txt", lines)
    starts = np.searchsorted(tracks.point, np.arange(len(points.xyz) + 1))
    lines = []
    for index, (start, end) in enumerate(pairwise(starts)):
        track = " ".join(f"{tracks.view[i] + 1} {place[i]}" for i in range(start, end))
        values = f"{_row(points.xyz[index])} {_row(points.rgb[index])} {float(points.error_px[index])!r}"
        lines.append(f"{index + 1} {values} {track}")
    _write(folder / "points3D.txt", lines)


def _row(values: object) -> str:
    return " ".join(repr(value.item() if isinstance(value, np.generic) else value) for value in values)  # type: ignore[attr-defined]


def _write(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in ["# written by aug3d", *lines]))
