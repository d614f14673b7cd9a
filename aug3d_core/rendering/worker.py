"""The render process: `python -m aug3d_core.rendering.worker job.json` renders one shard and ends.

A process per shard, because Blender's memory grows with every render and only its end gives it back. Progress goes to
standard output, one line `view DONE TOTAL` each; all that Blender prints is sent to standard error.

A shard holds, in the order of the camera file: view_id (n,), rgb (n,H,W,3) uint8 sRGB, alpha (n,H,W) uint8, and depth
(n,H,W) float16: along z, in world units, 0 where empty - unless the job goes without.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import TextIO

import numpy as np

from aug3d_core.parent import SUPERVISED, die_with_parent
from aug3d_core.rendering.blender import open_scene, render_colour, render_depth, set_camera
from aug3d_core.rendering.job import RenderJob


def render_shard(job: RenderJob, progress: TextIO) -> None:
    """Render the job's views and write them at once, so that a shard's file exists only when it is whole."""
    open_scene(job)
    with np.load(job.cameras, allow_pickle=False) as file:
        cameras = {
            name: file[name][job.first : job.last] for name in ("view_id", "world_from_cam", "intrinsics", "size")
        }
    width, height = cameras["size"][0]
    total = len(cameras["view_id"])
    shard = {
        "view_id": cameras["view_id"],
        "rgb": np.empty((total, height, width, 3), np.uint8),
        "alpha": np.empty((total, height, width), np.uint8),
    }
    if job.depth:
        shard["depth"] = np.empty((total, height, width), np.float16)
    with tempfile.TemporaryDirectory() as scratch:
        for i in range(total):
            set_camera(cameras["world_from_cam"][i], cameras["intrinsics"][i], cameras["size"][i])
            shard["rgb"][i], shard["alpha"][i] = render_colour(job, Path(scratch))
            if job.depth:
                shard["depth"][i] = render_depth(Path(scratch))
            print("view", i + 1, total, file=progress, flush=True)
    part = job.out.with_suffix(".part")
    with part.open("wb") as file:
        np.savez(file, **shard)
    part.replace(job.out)


def main() -> None:
    """Render the job named on the command line."""
    if SUPERVISED in os.environ:
        die_with_parent()
    job = RenderJob.model_validate_json(Path(sys.argv[1]).read_text())
    progress = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    render_shard(job, progress)


if __name__ == "__main__":
    main()
