"""Write a scene as a Zarr v3 store: one view is one chunk, `shard_views` views are one file, one process writes.

The attributes are written last, so that a store cut short has none and is refused; they hold a digest of every array's
values, so that a lost chunk is found (Zarr itself would answer zeros). Each chunk carries a checksum: one that is damaged
while training reads it is refused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import ZstdCodec

from aug3d_core.dataset.scene import BASELINE_ARRAYS, PICTURES, VIEW_ARRAYS, Scene

FORMAT = "aug3d scene"
VERSION = 3
PER_VIEW_PX = (*PICTURES, "baseline_images", "baseline_alpha")  # arrays with a chunk for each view


def arrays_of(scene: Scene) -> dict[str, np.ndarray]:
    """Return the scene's arrays by their path in the store."""
    arrays = {name: getattr(scene, name) for name in VIEW_ARRAYS}
    arrays |= {f"groups/{name}/members": members for name, members in sorted(scene.groups.items())}
    arrays |= {name.replace("_", "/", 1): getattr(scene, name) for name in BASELINE_ARRAYS}
    return arrays


def digest_of(dtype: np.dtype, shape: tuple[int, ...], parts: Iterable[np.ndarray]) -> str:
    """Digest the type, shape and values of an array of which the parts are read one after the other."""
    digest = _begun(dtype, shape)
    for part in parts:
        digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()


def _begun(dtype: np.dtype, shape: tuple[int, ...]) -> hashlib._Hash:
    return hashlib.sha256(f"{dtype.str}{shape}".encode())


def write(scene: Scene, path: Path, shard_views: int, said: Callable[[int], None] = lambda views: None) -> None:
    """Write the store into a new folder, one shard of all pictures after the other. said: is told how many views are there."""
    arrays = arrays_of(scene)
    root = zarr.create_group(path, zarr_format=3)
    digests = {}
    for name, values in arrays.items():
        if name not in PICTURES:
            digests[name] = _Written(root, name, values, shard_views).whole()
    pictures = [_Written(root, name, arrays[name], shard_views) for name in PICTURES]
    for first in range(0, len(scene), shard_views):
        said(first)
        for one in pictures:
            one.add(first)
    said(len(scene))
    digests |= {one.name: one.digest.hexdigest() for one in pictures}
    root.attrs.put(
        {
            **scene.attributes,
            "format": FORMAT,
            "version": VERSION,
            "slab": scene.slab.as_dict(),
            "scale": scene.scale,
            "digests": dict(sorted(digests.items())),
        }
    )


class _Written:
    """An array of the store, with the digest of what was written of it so far."""

    def __init__(self, root: zarr.Group, name: str, values: Any, shard_views: int) -> None:
        per_view = name.replace("/", "_") in PER_VIEW_PX
        chunks = (1, *values.shape[1:]) if per_view else tuple(max(1, n) for n in values.shape)
        shards = (shard_views, *values.shape[1:]) if per_view else None
        self.name, self._values, self._step = name, values, shard_views
        self.digest = _begun(values.dtype, values.shape)
        self._array = root.create_array(
            name,
            shape=values.shape,
            dtype=values.dtype,
            chunks=chunks,
            shards=shards,
            compressors=ZstdCodec(level=3, checksum=True),
        )

    def add(self, first: int) -> None:
        """Write one shard."""
        part = np.ascontiguousarray(self._values[first : first + self._step])
        self._array[first : first + self._step] = part
        self.digest.update(part.data)

    def whole(self) -> str:
        """Write everything at once; return its digest."""
        values = np.ascontiguousarray(self._values)
        if values.size:
            self._array[...] = values
        self.digest.update(values.data)
        return self.digest.hexdigest()
