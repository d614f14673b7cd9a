"""Packed scenes -> the layouts that other models train on.

chunks  of pixelSplat, MVSplat and DepthSplat: `{train,test}/000000.torch` with an `index.json` each
wai     of map-anything: a folder for each sequence, nerfstudio's layout with OpenCV poses, depth and masks
nerfstudio, colmap  a folder for each sequence, as tools for one scene read them

A sequence is what their loaders draw views from: the training photographs of a scene, in the order of the flight; a dome; the
flight over a made-up town; a test group, its inputs and its target. `evaluation_index.json` names the held-out targets.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from aug3d_core.dataset.scene import Scene
from aug3d_core.export.chunks import write_chunks
from aug3d_core.export.plain import write_colmap, write_nerfstudio
from aug3d_core.export.taken import TEST, TRAIN, Size, sequences
from aug3d_core.export.target_folder import filling
from aug3d_core.export.wai import write_wai
from aug3d_core.poses.recognise import COLMAP, NERFSTUDIO
from aug3d_core.run.errors import UsageError

CHUNKS, WAI = "chunks", "wai"
PACKED_FORMATS = {CHUNKS: write_chunks, WAI: write_wai, NERFSTUDIO: write_nerfstudio, COLMAP: write_colmap}
EVALUATION_INDEX = "evaluation_index.json"


def export_packed(
    scenes: Sequence[tuple[str, Scene, bool]], form: str, folder: Path, size: Size | None = None
) -> dict[str, int]:
    """Write scenes, each with its name and whether it may be trained on; return how many sequences are in each part.

    size: width and height of the views [px], None as packed. A view is cropped around its centre, then shrunk.
    Raises UsageError if the folder is not empty, there is no such format, or a view would have to grow.
    """
    if form not in PACKED_FORMATS:
        raise UsageError(f"there is no format {form!r}", f"choose one of {', '.join(PACKED_FORMATS)}")
    with filling(folder):
        for name, scene, _ in scenes:
            if size and (size[0] > scene.width_px or size[1] > scene.height_px):
                raise UsageError(
                    f"views of {size[0]}x{size[1]} px are larger than those of {name}, {scene.width_px}x{scene.height_px}",
                    "choose a smaller size, or pack the scene larger (dataset.width_px, dataset.height_px)",
                )
        taken = [one for name, scene, trained in scenes for one in sequences(name, scene, trained, size)]
        for part in (TRAIN, TEST):
            (folder / part).mkdir(parents=True)
        PACKED_FORMATS[form](taken, folder)
        index = {one.key: {"context": list(one.context), "target": list(one.target)} for one in taken if one.target}
        (folder / EVALUATION_INDEX).write_text(json.dumps(index, indent=1))
        return {part: sum(one.part == part for one in taken) for part in (TRAIN, TEST)}
