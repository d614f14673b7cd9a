"""Write a scene as a Zarr v3 store: one view is one chunk, `shard_views` views are one file, one process writes.

The attributes are written last, so that a store cut short has none and is refused; they hold a digest of every array's
values, so that a lost chunk is found (Zarr itself would answer zeros). Each chunk carries a checksum: one that is damaged
while training reads it is refused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import zarr
from zarr.codecs import ZstdCodec

from aug3d_core.dataset.scene import BASELINE_ARRAYS, PICTURES, VIEW_ARRAYS, Scene

FORMAT = "aug3d scene"
VERSION = 2
PER_VIEW_PX = (*PICTURES, "baseline_images", "baseline_alpha")  # arrays with a chunk for each view


def arrays_of(scene: Scene) -> dict[str, np.ndarray]:
    """Return the scene's arrays by their path in the store."""
    arrays = {name: getattr(scene, name) for name in VIEW_ARRAYS}
    arrays |= {f"groups/{name}/members": members for name, members in sorted(scene.groups.items())}
    arrays |= {name.replace("_", "/", 1): getattr(scene, name) for name in BASELINE_ARRAYS}
    return arrays


def digest(values: np.ndarray) -> str:
    """Digest an array's shape, type and values."""
    return digest_of(values.dtype, values.shape, [values])


def digest_of(dtype: np.dtype, shape: tuple[int, ...], parts: Iterable[np.ndarray]) -> str:
    """Digest an array of which the parts are read one after the other."""
    digest = hashlib.sha256(f"{dtype.str}{shape}".encode())
    for part in parts:
        digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()


def write(scene: Scene, path: Path, shard_views: int) -> None:
    """Write the store into a new folder."""
    arrays = arrays_of(scene)
    root = zarr.create_group(path, zarr_format=3)
    for name, values in arrays.items():
        _write_array(root, name, values, shard_views)
    root.attrs.put(
        {
            **scene.attributes,
            "format": FORMAT,
            "version": VERSION,
            "slab": scene.slab.as_dict(),
            "scale": scene.scale,
            "digests": {name: digest(values) for name, values in sorted(arrays.items())},
        }
    )


def _write_array(root: zarr.Group, name: str, values: np.ndarray, shard_views: int) -> None:
    per_view = name.replace("/", "_") in PER_VIEW_PX
    chunks = (1, *values.shape[1:]) if per_view else tuple(max(1, n) for n in values.shape)
    shards = (shard_views, *values.shape[1:]) if per_view else None
    array = root.create_array(
        name,
        shape=values.shape,
        dtype=values.dtype,
        chunks=chunks,
        shards=shards,
        compressors=ZstdCodec(level=3, checksum=True),
    )
    if values.size:
        array[...] = values
