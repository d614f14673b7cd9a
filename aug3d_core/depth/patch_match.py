"""COLMAP's patch-match stereo, for machines with a CUDA GPU and a pycolmap that was built for it."""

from __future__ import annotations

from pathlib import Path

import pycolmap

from aug3d_core.errors import InputError


def choose_engine(wanted: str) -> tuple[str, str]:
    """Return sweep or patch_match, and why; raises InputError when patch-match is asked for where it cannot run."""
    if wanted == "sweep":
        return "sweep", "asked for by depth.engine"
    if pycolmap.has_cuda:
        return "patch_match", "this pycolmap runs on CUDA"
    if wanted == "patch_match":
        raise InputError(
            "depth.engine=patch_match needs a pycolmap built with CUDA, and this one is not",
            "install pycolmap-cuda12 on a machine with an NVIDIA GPU, or set depth.engine=sweep",
        )
    return "sweep", "this pycolmap was built without CUDA"


def patch_match(workspace: Path) -> None:
    """Write photometric and geometric maps for each image that the workspace's patch-match.cfg lists."""
    pycolmap.patch_match_stereo(workspace, options=pycolmap.PatchMatchOptions(geom_consistency=True))
