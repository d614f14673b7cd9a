"""Depth maps -> points that several of them agree on, by COLMAP's fusion."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import numpy as np
import psutil
import pycolmap
from jaxtyping import UInt8

from aug3d_core.depth.workspace import write_fusion_list
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.views import Views
from aug3d_core.run.memory import total_bytes
from aug3d_core.run.scratch import scratch_folder

FEWEST_VIEWS = 2  # the maps hold only what others confirmed already
MOST_OFF_PX = 1.5
MOST_OFF_DEPTH = 0.01  # relative
MOST_OFF_NORMAL_DEG = 60.0  # normals of crowns and edges scatter; position and confirmation decide there
# Of the free memory; a cache that held half of twelve photographs, all of one place, took 40 times as long
CACHE_SHARE = 0.5
_PART = 1_000_000  # numbers that are read at a time
_POINT = np.dtype([("xyz", "<f4", 3), ("normal", "<f4", 3), ("rgb", "u1", 3)])


def fuse(workspace: Path, views: Views, chosen: list[int]) -> Fused:
    """Fuse the maps of the chosen views; no other view is touched. On one thread, so that the points' order is fixed."""
    if len(chosen) < FEWEST_VIEWS:
        return _points(np.zeros(0, _POINT), np.zeros(0, np.uint8))
    write_fusion_list(workspace, views, chosen)
    options = pycolmap.StereoFusionOptions()
    options.num_threads = 1
    options.min_num_pixels = FEWEST_VIEWS
    options.max_reproj_error = MOST_OFF_PX
    options.max_depth_error = MOST_OFF_DEPTH
    options.max_normal_error = MOST_OFF_NORMAL_DEG
    # Else all maps are in memory at once, 60 MB for a photograph of `paper`; the points are the same
    options.use_cache = True
    options.cache_size = CACHE_SHARE * min(psutil.virtual_memory().available, total_bytes()) / 2**30
    with scratch_folder(workspace / "fusion") as folder:
        ply = folder / "fused.ply"
        pycolmap.stereo_fusion(ply, workspace, input_type="geometric", options=options, output_type="ply")
        points = _read_ply(ply)
        return _points(points, _read_counts(ply.with_name("fused.ply.vis"), len(points)))


def _points(points: np.ndarray, views: UInt8[np.ndarray, " n"]) -> Fused:
    return Fused(points["xyz"].copy(), points["normal"].copy(), points["rgb"].copy(), views)


def _read_ply(path: Path) -> np.ndarray:
    """Read the one layout that COLMAP writes: float32 position and normal, 8-bit colour, little endian.

    Raises OSError if it is cut short: COLMAP says nothing of a full disk.
    """
    head, _, points = path.read_bytes().partition(b"end_header\n")
    told = re.search(rb"element vertex (\d+)", head)
    if told is None or len(points) != int(told[1]) * _POINT.itemsize:
        raise _cut_short(path)
    return np.frombuffer(points, _POINT)


def _read_counts(path: Path, points: int) -> UInt8[np.ndarray, " n"]:
    """Return the number of photographs of each point: after the number of points (uint64), a count and its image indices.

    Raises OSError if it is cut short, as `_read_ply` does.
    """
    held = max(path.stat().st_size - 8, 0) // 4
    numbers = np.memmap(path, "<u4", "r", offset=8, shape=held) if held else np.zeros(0, "<u4")
    counts, place, first = np.zeros(points, np.uint8), 0, 0
    part: list[int] = []  # as Python's numbers, each of which takes ten times the room
    for point in range(points):
        if place >= held:
            raise _cut_short(path)
        if place - first >= len(part):
            first, part = place, numbers[place : place + _PART].tolist()
        count = part[place - first]
        counts[point] = min(count, 255)
        place += count + 1
    if place > held:
        raise _cut_short(path)
    return counts


def _cut_short(path: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
