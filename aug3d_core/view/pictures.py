"""What the panel shows of a prediction, and of a photograph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

COLOUR, DEPTH, UNSEEN = "nothing", "depth", "no input sees this"
OVERLAYS = (COLOUR, DEPTH, UNSEEN)
_DEPTH_SHARE = 0.75  # of the overlay over the prediction
_MARK, _MARK_SHARE, _STRIPE_PX = np.array([233.0, 30.0, 150.0]), 0.7, 4
_WIDTH_PX = 512  # of the picture in the panel, however small what was predicted
_PHOTO_PX = 640


@dataclass(frozen=True)
class Predicted:
    """A predicted view. seen: some input shows it. photo_ids: of its inputs. half: of the size. seconds: that it took."""

    colour: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"] | None
    seen: Bool[np.ndarray, "h w"] | None
    photo_ids: tuple[int, ...]
    half: bool
    seconds: float


def overlaid(view: Predicted, overlay: str) -> UInt8[np.ndarray, "h w 3"]:
    """Return a prediction with what was asked for over it; as it is where the head does not tell that."""
    if overlay == DEPTH and view.depth is not None:
        from aug3d_core.judging.panels import depth_colours  # with torch: the page is there before it

        return _mixed(view.colour, depth_colours(view.depth), _DEPTH_SHARE)
    if overlay == UNSEEN and view.seen is not None:
        return marked(view.colour, ~view.seen)
    return view.colour


def marked(colour: UInt8[np.ndarray, "h w 3"], where: Bool[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture with stripes over some of its pixels."""
    y, x = np.mgrid[: colour.shape[0], : colour.shape[1]]
    striped = where & ((x + y) // _STRIPE_PX % 2 == 0)
    return np.where(striped[..., None], _mixed(colour, _MARK, _MARK_SHARE), colour)


def enlarged(colour: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture at the width that the panel has for it."""
    height = round(_WIDTH_PX * colour.shape[0] / colour.shape[1])
    return np.asarray(Image.fromarray(colour).resize((_WIDTH_PX, height), Image.Resampling.BILINEAR))


def photograph(file: Path) -> UInt8[np.ndarray, "h w 3"]:
    """Return a small copy of a photograph."""
    with Image.open(file) as image:
        small = image.convert("RGB")
        small.thumbnail((_PHOTO_PX, _PHOTO_PX))
    return np.asarray(small)


def _mixed(below: np.ndarray, above: np.ndarray, share: float) -> UInt8[np.ndarray, "h w 3"]:
    return np.rint((1 - share) * below + share * above).astype(np.uint8)
