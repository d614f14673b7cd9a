"""What a depth worker does with its share of the photographs. Written as JSON; arrays stay in the files it names."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from aug3d_core.run.stage import Frozen


class PhotoTask(Frozen):
    """One photograph: indices into the views of itself and of others, best first, and the ranges to search."""

    view: int
    sources: tuple[int, ...]  # that it is swept with
    others: tuple[int, ...]  # whose depth maps may confirm its own
    depth: tuple[float, float]  # nearest, farthest, along z
    height: tuple[float, float]  # lowest, highest


class DepthJob(Frozen):
    """A share of the photographs. `sweep` writes raw depth into `raw`; `compare` then keeps what others confirm.

    What an earlier try has written is left as it is.
    """

    step: Literal["sweep", "compare"]
    views: Path
    images: Path
    masks: Path  # of the views that have one
    raw: Path
    workspace: Path
    max_px: int
    plane_step_px: float
    tasks: tuple[PhotoTask, ...]
