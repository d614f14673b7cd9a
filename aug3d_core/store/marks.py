"""A mark: what nobody needed of a shared store when someone looked. `sweep` leaves them, `Shared` heeds them."""

from __future__ import annotations

import json
from dataclasses import dataclass

from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket


@dataclass(frozen=True)
class Mark:
    """Objects, as stage/key, and SHA-256 of bytes that no record names. name: in the bucket, "" of none."""

    objects: frozenset[str] = frozenset()
    blobs: frozenset[str] = frozenset()
    name: str = ""


def read_mark(bucket: Bucket, name: str) -> Mark:
    """Return a mark; an empty one if it is gone or damaged, so that nothing goes by it."""
    try:
        told = json.loads(bucket.get(name) or b"")
        return Mark(frozenset(told["objects"]), frozenset(told["blobs"]), name)
    except (ValueError, KeyError, TypeError):
        return Mark(name=name)


def newest_mark(bucket: Bucket) -> Mark:
    """Return the mark that was left last, an empty one if there is none."""
    names = bucket.names(f"{layout.MARKS}/")
    return read_mark(bucket, names[-1]) if names else Mark()


def leave_mark(bucket: Bucket, mark: Mark) -> str:
    """Put a mark behind those that are there; return its name."""
    content = json.dumps({"objects": sorted(mark.objects), "blobs": sorted(mark.blobs)}).encode()
    while True:
        names = bucket.names(f"{layout.MARKS}/")
        name = f"{layout.MARKS}/{int(names[-1].rpartition('/')[2]) + 1 if names else 0:08d}"
        if bucket.create(name, content):
            return name
