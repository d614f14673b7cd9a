"""Renders of domes -> packed views. A dome is a group of K views; one that lost a view to the checks is left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, Float16, Int, UInt8

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.images import fit
from aug3d_core.dataset.slab import Slab
from aug3d_core.domes.files import CAMERAS
from aug3d_core.rendering.files import RENDER_TABLE, SHARDS, shard_name


@dataclass(frozen=True)
class RenderedViews:
    """The renders of the domes that are still groups, dome after dome, each dome's K views in order of view_id."""

    images: UInt8[np.ndarray, "m h w 3"]
    alpha: UInt8[np.ndarray, "m h w"]
    depth: Float16[np.ndarray, "m h w"]
    world_from_cam: Float[np.ndarray, "m 4 4"]
    intrinsics: Float[np.ndarray, "m 4"]
    near_far: Float[np.ndarray, "m 2"]
    dome_id: Int[np.ndarray, " m"]
    domes_dropped: int


def no_rendered(config: DatasetConfig) -> RenderedViews:
    """Return what a data set of photographs alone holds of renders: nothing."""
    size = (config.height_px, config.width_px)
    return RenderedViews(
        np.zeros((0, *size, 3), np.uint8),
        np.zeros((0, *size), np.uint8),
        np.zeros((0, *size), np.float16),
        np.zeros((0, 4, 4)),
        np.zeros((0, 4)),
        np.zeros((0, 2)),
        np.zeros(0, np.int32),
        0,
    )


def pack_rendered(sampling: Path, rendering: Path, members: int, slab: Slab, config: DatasetConfig) -> RenderedViews:
    """Collect the kept renders of every dome that still has `members` of them; none where no views were planned."""
    table = pd.read_parquet(rendering / RENDER_TABLE).sort_values(["dome_id", "view_id"])
    kept = _whole_domes(table, members)
    with np.load(sampling / CAMERAS, allow_pickle=False) as file:
        cameras = {name: file[name] for name in ("view_id", "world_from_cam", "intrinsics", "size")}
    order = np.argsort(cameras["view_id"])
    rows = order[np.searchsorted(cameras["view_id"], np.asarray(kept["view_id"]), sorter=order)]
    fits = [fit(int(w), int(h), config.width_px, config.height_px) for w, h in cameras["size"][rows]]
    pixels = [f.covered(*arrays) for f, arrays in zip(fits, _renders(rendering, kept), strict=True)]
    world_from_cam = cameras["world_from_cam"][rows].astype(np.float64)
    intrinsics = np.array([f.intrinsics(k) for f, k in zip(fits, cameras["intrinsics"][rows], strict=True)])
    size = (config.width_px, config.height_px)
    bounds = [
        near_far(slab, w, k, size, d[d > 0]) for w, k, (_, _, d) in zip(world_from_cam, intrinsics, pixels, strict=True)
    ]
    return RenderedViews(
        _stack([p[0] for p in pixels], (*size[::-1], 3), np.uint8),
        _stack([p[1] for p in pixels], size[::-1], np.uint8),
        _stack([p[2] for p in pixels], size[::-1], np.float16),
        world_from_cam.reshape(-1, 4, 4),
        intrinsics.reshape(-1, 4),
        np.array(bounds).reshape(-1, 2),
        np.asarray(kept["dome_id"], np.int32),
        len(np.unique(table["dome_id"])) - len(np.unique(kept["dome_id"])),
    )


def _whole_domes(table: pd.DataFrame, members: int) -> pd.DataFrame:
    """Return the first `members` kept views of each dome that has as many; the table is sorted by dome."""
    seen = table[table["kept"]].copy()
    _, first, size = np.unique(seen["dome_id"], return_index=True, return_counts=True)
    rows = [np.arange(start, start + members) for start, n in zip(first, size, strict=True) if n >= members]
    return seen.iloc[np.concatenate(rows) if rows else []]


def _renders(rendering: Path, table: pd.DataFrame):
    """Yield (colour, alpha, depth) of each row of the render table; each shard is opened once."""
    shards: dict[int, dict[str, np.ndarray]] = {}
    for shard in sorted(table["shard"].unique()):
        with np.load(rendering / SHARDS / shard_name(int(shard)), allow_pickle=False) as file:
            shards[shard] = {name: file[name] for name in ("rgb", "alpha", "depth")}
    for shard, row in zip(table["shard"], table["row"], strict=True):
        arrays = shards[shard]
        yield arrays["rgb"][row], arrays["alpha"][row], arrays["depth"][row].astype(np.float32)


def _stack(arrays: list[np.ndarray], shape: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.stack(arrays).astype(dtype) if arrays else np.zeros((0, *shape), dtype)
