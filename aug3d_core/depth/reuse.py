"""Copy the maps of an earlier output that would come out the same, so that only what a change touches is made again.

A photograph's maps are known by a digest of all that they are made of: its own image, mask, camera and ranges, those of the
photographs that it is swept with, and the same of each photograph whose depth may confirm its own.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Int

from aug3d_core.depth.files import DEPTH_MAPS, MADE_OF, NORMAL_MAPS, geometric_map_name
from aug3d_core.depth.job import PhotoTask
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.atomic_file import replacing


def made_of(
    tasks: Sequence[PhotoTask], views: Views, sizes: Int[np.ndarray, "n 2"], images: Path, masks: Path
) -> dict[int, str]:
    """Return by view the digest of all that its maps are made of. sizes: of the maps, width and height."""
    seen = {view: _of_view(view, views, sizes, images, masks) for task in tasks for view in (task.view, *task.sources)}
    swept = {
        task.view: _digest(seen[task.view], np.array([task.depth, task.height]), *(seen[one] for one in task.sources))
        for task in tasks
    }
    return {task.view: _digest(swept[task.view], *(swept[one] for one in task.others)).hex() for task in tasks}


def copy_known(digests: dict[int, str], views: Views, earlier: Path | None, out: Path) -> set[int]:
    """Copy the maps that an earlier output has of the same, not twice; return the views that have theirs from there.

    earlier: folder of such outputs.
    """
    found: dict[str, tuple[Path, int]] = {}
    for files in sorted(earlier.iterdir()) if earlier is not None and earlier.exists() else []:
        if (files / MADE_OF).exists():
            was = json.loads((files / MADE_OF).read_text())
            found = {digest: (files, int(photo_id)) for photo_id, digest in was.items()} | found
    known = {view for view, digest in digests.items() if digest in found}
    for view in known:
        files, photo_id = found[digests[view]]
        for folder in (DEPTH_MAPS, NORMAL_MAPS):  # the normal map last: it says that both are there
            path = out / folder / geometric_map_name(int(views.photo_id[view]))
            if not path.exists():
                source = files / folder / geometric_map_name(photo_id)
                with source.open("rb") as there, replacing(path, path.with_name(f".{path.name}")) as here:
                    shutil.copyfileobj(there, here)
    return known


def write_made_of(digests: dict[int, str], views: Views, path: Path) -> None:
    """Write what the maps of each photograph are made of, by photo id."""
    path.write_text(json.dumps({str(views.photo_id[view]): digest for view, digest in digests.items()}, indent=1))


def _of_view(view: int, views: Views, sizes: Int[np.ndarray, "n 2"], images: Path, masks: Path) -> bytes:
    name = image_name(int(views.photo_id[view]))
    files = [folder / name for folder in (images, masks)]
    camera = (views.cam_from_world[view], views.intrinsics[view], views.size[view], sizes[view])
    return _digest(*camera, *(file.read_bytes() if file.exists() else b"" for file in files))


def _digest(*parts: bytes | np.ndarray) -> bytes:
    """Return the SHA-256 of parts, each by its own digest: none can be taken for the end of another."""
    return hashlib.sha256(
        b"".join(hashlib.sha256(part if isinstance(part, bytes) else part.tobytes()).digest() for part in parts)
    ).digest()
