"""The depth process: `python -m aug3d_core.depth.worker job.json` works through one share of the photographs.

A process of its own, because OpenCV and pycolmap in one process corrupt memory; on one thread, so that two of them fill two
cores and a photograph's result does not depend on how many there are. What a killed try has written whole is not made again.
A sweep reports for each photograph how many planes were tried.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from aug3d_core.depth.cameras import Camera, camera_of, depth_sizes
from aug3d_core.depth.coherence import filled, without_islands
from aug3d_core.depth.consistency import DepthMap, confirm
from aug3d_core.depth.files import WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS, geometric_map_name, planes_name
from aug3d_core.depth.job import DepthJob, PhotoTask
from aug3d_core.depth.normals import normals_of
from aug3d_core.depth.search import Range, families_for, ranges_for, reduced
from aug3d_core.depth.sweep import Photo, sweep
from aug3d_core.geometry.depth_maps import read_map, write_map
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.helper_process import begin

LEAST_SCORE = 0.4
# Other depth maps that agree. Measured on two town photographs: asking for two keeps 54 to 58 % of the facades' pixels, not
# 70 to 72 %, and lowers what is wrong by over 1 % of depth from 6.4 to 5.2 % of what is kept; fusion averages most of it away.
ENOUGH_AGREE = 1
COARSER = (2, 4)  # sizes whose sweeps fill what is left open; together they cost a sixth of the full size
_CACHED = 32  # images or maps kept in memory: neighbours are needed again soon


class _Share:
    """The views of a job, and their images and depth maps, read once."""

    def __init__(self, job: DepthJob) -> None:
        self.job = job
        self.views = Views.load(job.views)
        self.sizes = depth_sizes(self.views, job.max_px)
        self.photo = lru_cache(_CACHED)(self._photo)
        self.raw_depth = lru_cache(_CACHED)(self._raw_depth)

    def camera(self, view: int) -> Camera:
        return camera_of(self.views, view, self.sizes[view])

    def raw_path(self, view: int) -> Path:
        return self.job.raw / geometric_map_name(int(self.views.photo_id[view]))

    def _photo(self, view: int) -> Photo:
        path = self.job.images / image_name(int(self.views.photo_id[view]))
        grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        camera = self.camera(view)
        if grey.shape != (camera.height, camera.width):
            grey = cv2.resize(grey, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        grey = np.maximum(grey, 1)
        used = used_pixels(self.job.masks / path.name, (camera.width, camera.height))
        return Photo(grey if used is None else np.where(used, grey, np.uint8(0)), camera)

    def _raw_depth(self, view: int) -> DepthMap:
        return DepthMap(read_map(self.raw_path(view)), self.camera(view))


def sweep_photo(share: _Share, task: PhotoTask) -> int:
    """Write the raw depth map of one photograph and return the number of planes tried."""
    told = share.job.raw / planes_name(int(share.views.photo_id[task.view]))
    if told.exists():
        return int(told.read_text())
    reference, sources = share.photo(task.view), [share.photo(view) for view in task.sources]
    step_px = share.job.plane_step_px
    ranges = ranges_for(reference, sources, task, step_px)
    depth, planes = _certain(reference, sources, ranges, step_px)
    for by in COARSER:
        coarse, _ = _certain(reduced(reference, by), [reduced(source, by) for source in sources], ranges, step_px)
        depth = np.where(reference.grey > 0, filled(depth, coarse), np.float32(0))
    write_map(share.raw_path(task.view), depth)
    write_synced(told, str(planes).encode())
    return planes


def _certain(reference: Photo, sources: list[Photo], ranges: list[Range], step_px: float) -> tuple[np.ndarray, int]:
    """Return the depth that is certain and hangs together, and the number of planes tried."""
    families = families_for(reference.camera, [source.camera for source in sources], ranges, step_px)
    found = sweep(reference, sources, families)
    depth = np.where((found.score > LEAST_SCORE) & (reference.grey > 0), found.depth, np.float32(0))
    return without_islands(depth), sum(len(family.inverse_distance) for family in families)


def compare_photo(share: _Share, task: PhotoTask) -> None:
    """Write the depth and, last, the normal map of what others confirm."""
    name = geometric_map_name(int(share.views.photo_id[task.view]))
    normals = share.job.workspace / WORKSPACE_NORMAL_MAPS / name
    if normals.exists():
        return
    own = share.raw_depth(task.view)
    found = confirm(own, [share.raw_depth(view) for view in task.others])
    depth = np.where(found.agreeing >= ENOUGH_AGREE, found.depth, np.float32(0))
    depth = without_islands(depth)
    write_map(share.job.workspace / WORKSPACE_DEPTH_MAPS / name, depth)
    write_map(normals, normals_of(depth, own.camera))


def main() -> None:
    """Work through the job named on the command line."""
    job, report = begin(DepthJob)
    cv2.setNumThreads(1)
    share = _Share(job)
    for task in job.tasks:
        if job.step == "sweep":
            report(str(sweep_photo(share, task)))
        else:
            compare_photo(share, task)
            report("")


if __name__ == "__main__":
    main()
