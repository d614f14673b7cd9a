"""The render process: `python -m aug3d_core.rendering.worker job.json` renders the shards of a job.

The meshes are loaded once for many shards. But Blender's memory may grow with every render and is freed only when the
process ends: a process that has grown too far ends, and another one renders the remaining shards. It reports a ViewDone
after each view.

A shard holds, in the order of the camera file: view_id (n,), rgb (n,H,W,3) uint8 sRGB, alpha (n,H,W) uint8 and, if the job
asks for it, depth (n,H,W) float16: along z, in world units, 0 where empty.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil

from aug3d_core.rendering.blender import open_scene, render_view, set_camera
from aug3d_core.rendering.job import RenderJob, Shard, ViewDone
from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.helper_process import begin


def render_shards(job: RenderJob, report: Callable[[str], None]) -> None:
    """Render the job's shards until memory has grown too far. Each file is written atomically and holds a whole shard."""
    open_scene(job)
    at_first = grown = 0.0
    with np.load(job.cameras, allow_pickle=False) as file:
        cameras = {name: file[name] for name in ("view_id", "world_from_cam", "intrinsics", "size")}
    with tempfile.TemporaryDirectory(dir=job.shards[0].out.parent) as scratch:  # on the disk that is watched
        for shard in job.shards:
            if shard.out.exists():  # another machine made it meanwhile
                continue
            arrays = _arrays(job, shard, cameras)
            for row, view in enumerate(range(shard.first, shard.last)):
                set_camera(*(cameras[name][view] for name in ("world_from_cam", "intrinsics", "size")))
                picture = render_view(shard, Path(scratch))
                for name in arrays.keys() - {"view_id"}:
                    arrays[name][row] = getattr(picture, name)
                resident = resident_mib()
                at_first = at_first or resident
                grown = max(grown, resident - at_first)
                report(ViewDone(cycles_s=picture.cycles_s, resident_mib=resident).model_dump_json())
            _write(shard.out, arrays)
            if grown >= job.growth_mib:
                return


def _arrays(job: RenderJob, shard: Shard, cameras: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    views = slice(shard.first, shard.last)
    width, height = cameras["size"][shard.first]
    size = (shard.last - shard.first, height, width)
    arrays = {
        "view_id": cameras["view_id"][views],
        "rgb": np.empty((*size, 3), np.uint8),
        "alpha": np.empty(size, np.uint8),
    }
    return arrays | {"depth": np.empty(size, np.float16)} if job.depth else arrays


def _write(out: Path, arrays: dict[str, np.ndarray]) -> None:
    with replacing(out, out.with_suffix(".part")) as file:
        np.savez(file, **arrays)


def resident_mib() -> float:
    """Return the resident memory of this process [MiB]."""
    return psutil.Process().memory_info().rss / 2**20


def main() -> None:
    """Render the job named on the command line."""
    render_shards(*begin(RenderJob))


if __name__ == "__main__":
    main()
