"""Renders of domes -> packed views. A dome is a group of K views; one that lost a view to the checks is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, Float16, Int, UInt8

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.by_view import OnDemand
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.images import fit
from aug3d_core.dataset.slab import Slab
from aug3d_core.domes.files import CAMERAS
from aug3d_core.rendering.files import RENDER_TABLE, SHARDS, shard_name

Pixels = tuple[np.ndarray, np.ndarray, np.ndarray]  # colour, alpha, depth
_HELD_VIEWS = 64  # in memory: what is written next to each other is asked for together


@dataclass(frozen=True)
class RenderedViews:
    """The renders of the domes that are still groups, dome after dome, each dome's K views in order of view_id."""

    images: UInt8[OnDemand, "m h w 3"]
    alpha: UInt8[OnDemand, "m h w"]
    depth: Float16[OnDemand, "m h w"]
    world_from_cam: Float[np.ndarray, "m 4 4"]
    intrinsics: Float[np.ndarray, "m 4"]
    near_far: Float[np.ndarray, "m 2"]
    dome_id: Int[np.ndarray, " m"]
    domes_dropped: int
    enlarged: float = 1.0  # packed pixels along one of the smallest render


def no_rendered(config: DatasetConfig) -> RenderedViews:
    """Return what a data set of photographs alone holds of renders: nothing."""
    none = {"world_from_cam": np.zeros((0, 4, 4)), "intrinsics": np.zeros((0, 4)), "near_far": np.zeros((0, 2))}
    return RenderedViews(*_on_demand(0, config, _nothing), **none, dome_id=np.zeros(0, np.int32), domes_dropped=0)


def pack_rendered(sampling: Path, rendering: Path, members: int, slab: Slab, config: DatasetConfig) -> RenderedViews:
    """Collect the kept renders of every dome that still has `members` of them; none where no views were planned."""
    table = pd.read_parquet(rendering / RENDER_TABLE).sort_values(["dome_id", "view_id"])
    kept = _whole_domes(table, members)
    with np.load(sampling / CAMERAS, allow_pickle=False) as file:
        cameras = {name: file[name] for name in ("view_id", "world_from_cam", "intrinsics", "size")}
    order = np.argsort(cameras["view_id"])
    rows = order[np.searchsorted(cameras["view_id"], np.asarray(kept["view_id"]), sorter=order)]
    fits = [fit(int(w), int(h), config.width_px, config.height_px) for w, h in cameras["size"][rows]]
    shards, places = np.asarray(kept["shard"], int), np.asarray(kept["row"], int)

    @lru_cache(maxsize=2)
    def shard(number: int) -> dict[str, np.ndarray]:
        with np.load(rendering / SHARDS / shard_name(number), allow_pickle=False) as file:
            return {name: file[name] for name in ("rgb", "alpha", "depth")}

    @lru_cache(maxsize=_HELD_VIEWS)
    def pixels(view: int) -> Pixels:
        arrays, row = shard(int(shards[view])), places[view]
        return fits[view].covered(arrays["rgb"][row], arrays["alpha"][row], arrays["depth"][row].astype(np.float32))

    world_from_cam = cameras["world_from_cam"][rows].astype(np.float64)
    intrinsics = np.array([f.intrinsics(k) for f, k in zip(fits, cameras["intrinsics"][rows], strict=True)])
    size = (config.width_px, config.height_px)
    bounds = []
    for view in range(len(kept)):
        depth = pixels(view)[2]
        bounds.append(near_far(slab, world_from_cam[view], intrinsics[view], size, depth[depth > 0]))
    return RenderedViews(
        *_on_demand(len(kept), config, pixels),
        world_from_cam.reshape(-1, 4, 4),
        intrinsics.reshape(-1, 4),
        np.array(bounds).reshape(-1, 2),
        np.asarray(kept["dome_id"], np.int32),
        len(np.unique(table["dome_id"])) - len(np.unique(kept["dome_id"])),
        max((f.enlarged for f in fits), default=1.0),
    )


def _whole_domes(table: pd.DataFrame, members: int) -> pd.DataFrame:
    """Return the first `members` kept views of each dome that has as many; the table is sorted by dome."""
    seen = table[table["kept"]].copy()
    _, first, size = np.unique(seen["dome_id"], return_index=True, return_counts=True)
    rows = [np.arange(start, start + members) for start, n in zip(first, size, strict=True) if n >= members]
    return seen.iloc[np.concatenate(rows) if rows else []]


def _on_demand(
    count: int, config: DatasetConfig, pixels: Callable[[int], Pixels]
) -> tuple[OnDemand, OnDemand, OnDemand]:
    size = (config.height_px, config.width_px)
    return (
        OnDemand(count, (*size, 3), np.uint8, lambda view: pixels(view)[0]),
        OnDemand(count, size, np.uint8, lambda view: pixels(view)[1]),
        OnDemand(count, size, np.float16, lambda view: pixels(view)[2]),
    )


def _nothing(view: int) -> Pixels:
    raise IndexError(view)
