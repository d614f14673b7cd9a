"""COLMAP's patch-match stereo, for machines with a CUDA GPU and a pycolmap that was built for it."""

from __future__ import annotations

from pathlib import Path

import pycolmap

from aug3d_core.run.errors import InputError


def choose_engine(wanted: str) -> tuple[str, str]:
    """Return sweep or patch_match, and why; raises InputError when patch-match is asked for where it cannot run."""
    if wanted == "sweep":
        return "sweep", "asked for by depth.engine"
    lacking = _lacking()
    if not lacking:
        return "patch_match", "this pycolmap runs on CUDA"
    if wanted == "patch_match":
        raise InputError(
            f"depth.engine=patch_match cannot run: {lacking}",
            "install pycolmap-cuda12 on a machine with an NVIDIA GPU, or set depth.engine=sweep",
        )
    return "sweep", lacking


def _lacking() -> str:
    """Return what patch-match lacks here, or nothing. What pycolmap was built for says nothing of the machine."""
    if not pycolmap.has_cuda:
        return "this pycolmap was built without CUDA"
    devices = pycolmap.get_num_cuda_devices()  # type: ignore[attr-defined]  # others lack it
    return "" if devices else "no CUDA GPU is visible"


def patch_match(workspace: Path) -> None:
    """Write photometric and geometric maps for each image that the workspace's patch-match.cfg lists."""
    pycolmap.patch_match_stereo(workspace, options=pycolmap.PatchMatchOptions(geom_consistency=True))
