"""COLMAP's patch-match stereo, for machines with a CUDA GPU and a pycolmap that was built for it."""

from __future__ import annotations

from pathlib import Path

import pycolmap

from aug3d_core.run.errors import InputError


def check_patch_match() -> None:
    """Raise InputError where patch-match cannot run. What pycolmap was built for says nothing of the machine."""
    if not pycolmap.has_cuda:
        lacking = "this pycolmap was built without CUDA"
    elif not pycolmap.get_num_cuda_devices():  # type: ignore[attr-defined]  # others lack it
        lacking = "no CUDA GPU is visible"
    else:
        return
    raise InputError(
        f"depth.engine=patch_match cannot run: {lacking}",
        "install pycolmap-cuda12 on a machine with an NVIDIA GPU, or set depth.engine=sweep",
    )


def patch_match(workspace: Path) -> None:
    """Write photometric and geometric maps for each image that the workspace's patch-match.cfg lists."""
    pycolmap.patch_match_stereo(workspace, options=pycolmap.PatchMatchOptions(geom_consistency=True))
