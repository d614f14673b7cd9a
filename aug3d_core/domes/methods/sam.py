"""Domes over buildings whose outlines come from Segment Anything (Kirillov et al. 2023), as in the paper's appendix.

That model outlines whatever it sees in the picture from above and names nothing: what of it is built is told by height
and colour, as in `orthographic.py`. It runs in a worker process, for torch must not share one with the ray caster.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.methods.buildings import plan_over
from aug3d_core.domes.methods.sam_job import SamJob
from aug3d_core.domes.orthographic import Slice
from aug3d_core.domes.sam_weights import WHERE, find_weights
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.run.errors import InputError
from aug3d_core.run.helper_process import run_worker


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan domes over the buildings that Segment Anything outlines. Raises InputError without library or weights."""
    weights, on_disk = find_weights(config.sam_weights)
    rgb = site.ground.rgb
    return plan_over(lambda piece: outlines(rgb, piece, weights, on_disk), surface, site, config, rng)


def outlines(rgb: UInt8[np.ndarray, "y x 3"], piece: Slice, weights: str, on_disk: bool) -> Bool[np.ndarray, "y x"]:
    """Return the union of outlines that hold what is built. Raises InputError where the weights cannot be loaded."""
    with tempfile.TemporaryDirectory() as scratch:
        picture, out = Path(scratch) / "picture.npz", Path(scratch) / "mask.npz"
        np.savez(picture, rgb=rgb[::-1], built=piece.built[::-1])  # north up, as in pictures
        job = SamJob(picture=picture, weights=weights, on_disk=on_disk, out=out)
        complaints: list[str] = []
        name = "the worker of Segment Anything"
        run_worker("aug3d_core.domes.methods.sam_worker", job, complaints.append, name, "choose a smaller model")
        if complaints:
            raise InputError(f"sampling.sam_weights {weights} cannot be loaded: {complaints[0]}", WHERE)
        with np.load(out, allow_pickle=False) as answer:
            return answer["mask"][::-1]
