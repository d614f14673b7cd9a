"""What the worker of `sam.py` is asked: to outline, in a picture, what is built."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from aug3d_core.run.stage import Frozen


class SamJob(Frozen):
    """`picture` holds rgb (h, w, 3) and built (h, w); the outlines' union is written to `out` as mask (h, w)."""

    picture: Path
    weights: str
    on_disk: bool = Field(description="Whether `weights` is a folder; else it is a name on the hub.")
    out: Path
