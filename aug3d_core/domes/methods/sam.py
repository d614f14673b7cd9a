"""Domes over buildings whose outlines come from Segment Anything (Kirillov et al. 2023), as in the paper's appendix.

That model outlines whatever it sees in the picture from above and names nothing: what of it is built is told by height
and colour, as in `orthographic.py`. It runs in a worker process, for torch must not share one with the ray caster.
"""

from __future__ import annotations

import re
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.config import SAM_FILES, SamplingConfig
from aug3d_core.domes.methods.buildings import plan_over
from aug3d_core.domes.methods.sam_job import SamJob
from aug3d_core.domes.orthographic import Slice
from aug3d_core.domes.site import Site
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.run.errors import InputError
from aug3d_core.run.helper_process import run_worker

_ON_THE_HUB = re.compile(r"[\w.-]+/[\w.-]+")
_WHERE = (
    "set sampling.sam_weights to a folder with config.json and model.safetensors of a Segment Anything model, or to one's "
    "name on the Hugging Face hub, such as facebook/sam-vit-base"
)


def plan(surface: Raycaster, site: Site, config: SamplingConfig, rng: np.random.Generator) -> Plan:
    """Plan domes over the buildings that Segment Anything outlines. Raises InputError without library or weights."""
    weights, on_disk = find_weights(config.sam_weights)
    rgb = site.ground.rgb
    return plan_over(lambda piece: outlines(rgb, piece, weights, on_disk), surface, site, config, rng)


def find_weights(setting: str | None) -> tuple[str, bool]:
    """Return what the setting names, and whether it is a folder on disk. Raises InputError where it names nothing."""
    if find_spec("transformers") is None:
        raise InputError(
            "sampling.method sam needs the package transformers, which is not installed",
            "install it with: pip install 'aug3d[sam]', or choose sampling.method buildings",
        )
    if not setting:
        raise InputError("sampling.method sam needs weights, and sampling.sam_weights is empty", _WHERE)
    folder = Path(setting).expanduser()
    folder = folder.parent if folder.is_file() else folder
    if folder.is_dir():
        for name in SAM_FILES:
            if not (folder / name).is_file():
                raise InputError(f"sampling.sam_weights {setting} has no {name}", _WHERE)
        return str(folder.resolve()), True
    if not _ON_THE_HUB.fullmatch(setting):
        raise InputError(f"sampling.sam_weights {setting} is no folder and no name on the hub", _WHERE)
    return setting, False


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
            raise InputError(f"sampling.sam_weights {weights} cannot be loaded: {complaints[0]}", _WHERE)
        with np.load(out, allow_pickle=False) as answer:
            return answer["mask"][::-1]
