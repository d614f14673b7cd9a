"""Read a packed scene back, and refuse one that cannot be trusted. `zarr.open(path)` reads it without us."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import zarr

from aug3d_core.dataset.on_disk import Cache, OnDisk
from aug3d_core.dataset.scene import BASELINE_ARRAYS, GROUPS, PICTURES, VIEW_ARRAYS, Scene, check
from aug3d_core.dataset.slab import Slab
from aug3d_core.dataset.writer import FORMAT, VERSION, digest_of
from aug3d_core.run.errors import InputError

AGAIN = "pack the scene again (stage dataset)"


def read(path: Path, cache: Cache | None = None) -> Scene:
    """Read a scene, and compare every array with its digest.

    cache: leave the pictures on disk and hold what fits into it; None for a scene whole in memory.
    """
    root = _open(path)
    attributes: dict[str, Any] = dict(root.attrs)
    if attributes.get("format") != FORMAT or attributes.get("version") != VERSION:
        found = f"{attributes.get('format', 'no format')} version {attributes.get('version', 'none')}"
        raise InputError(f"{path.name} is {found}, not {FORMAT} version {VERSION}", AGAIN)
    digests = attributes.pop("digests")
    views = {name: _values(root, name, digests, cache if name in PICTURES else None) for name in VIEW_ARRAYS}
    baseline = {name: _values(root, name.replace("_", "/", 1), digests) for name in BASELINE_ARRAYS}
    groups = {name: _values(root, f"groups/{name}/members", digests) for name in GROUPS}
    slab, scale = Slab(**attributes.pop("slab")), attributes.pop("scale")
    return check(Scene(**views, **baseline, groups=groups, slab=slab, scale=scale, attributes=attributes), path.name)


def _open(path: Path) -> zarr.Group:
    try:
        return zarr.open_group(path, mode="r", zarr_format=3)
    except (FileNotFoundError, ValueError) as error:
        raise InputError(f"{path.name} is no Zarr v3 store", AGAIN) from error


def _values(root: zarr.Group, name: str, digests: dict[str, str], cache: Cache | None = None) -> Any:
    try:
        array: Any = root[name]
        values = np.asarray(array[...]) if cache is None else OnDisk(array, cache)
        parts = values.shards() if isinstance(values, OnDisk) else [values]
        found = digest_of(values.dtype, values.shape, parts)
    except (KeyError, ValueError, RuntimeError, OSError) as error:
        raise InputError(f"array {name} of {root.store} cannot be read ({error})", AGAIN) from error
    if found != digests.get(name):
        raise InputError(f"array {name} of {root.store} is not what was packed (a chunk is missing or damaged)", AGAIN)
    return values
