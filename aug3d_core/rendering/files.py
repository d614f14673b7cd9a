"""The files that the stages of this package write."""

from __future__ import annotations

SHARDS = "shards"
RENDER_TABLE = "renders.parquet"


def shard_name(shard: int) -> str:
    """Name of one render shard's file inside `shards/`."""
    return f"{shard:04d}.npz"
