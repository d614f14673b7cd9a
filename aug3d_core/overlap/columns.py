"""The photographs of sample groups: a column for each way of grouping, members from top to bottom, bad ones framed in red."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Int
from PIL import Image, ImageDraw, ImageFont

from aug3d_core.geometry.views import Views
from aug3d_core.overlap.pair_overlaps import BAD, PairOverlaps
from aug3d_core.photos.files import image_name

_WIDTH, _GAP, _HEADER, _LABEL, _FRAME = 168, 8, 24, 18, 5  # px
_RED, _BLUE, _INK = (214, 30, 30), (30, 90, 200), (20, 20, 20)


def draw_columns(
    photo: Callable[[int], Image.Image],
    views: Views,
    groups: Mapping[str, Int[np.ndarray, "p k"]],
    overlaps: PairOverlaps,
) -> Image.Image:
    """Draw a block for each place, in it a column for each way; `photo` returns the picture of a view.

    Under each photo stands its true overlap with the centre, the topmost photo, framed in blue.
    """
    places, k = next(iter(groups.values())).shape
    height = round(_WIDTH * float(np.median(views.size[:, 1] / views.size[:, 0])))
    step_x, step_y = _WIDTH + _GAP, height + _LABEL + _GAP
    block = len(groups) * step_x + 3 * _GAP
    sheet = Image.new("RGB", (places * block, 3 * _HEADER + k * step_y), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for place in range(places):
        left = place * block
        draw.text((left, 2), f"place {place + 1}", fill=_INK, font=font)
        for column, (method, members) in enumerate(groups.items()):
            x = left + column * step_x
            told = f"{method}\n{_bad(members[place], overlaps)} of {k - 1} bad"
            draw.text((x, _HEADER), told, fill=_INK, font=font)
            for row, view in enumerate(members[place].tolist()):
                y = 3 * _HEADER + row * step_y
                sheet.paste(photo(view).resize((_WIDTH, height), Image.Resampling.BOX), (x, y))
                _label(draw, (x, y), height, int(views.photo_id[view]), _with_centre(members[place], row, overlaps))
    return sheet


def photo_file(images: Path, views: Views, view: int) -> Image.Image:
    """Read the picture of a view from a folder that holds them by photo_id."""
    with Image.open(images / image_name(int(views.photo_id[view]))) as image:
        return image.convert("RGB")


def _with_centre(members: Int[np.ndarray, " k"], row: int, overlaps: PairOverlaps) -> float | None:
    """Return the overlap of a member with its group's centre; None for the centre itself."""
    return None if row == 0 else float(overlaps.of(members[:1], members[row : row + 1])[0])


def _bad(members: Int[np.ndarray, " k"], overlaps: PairOverlaps) -> int:
    return sum(overlap is not None and overlap < BAD for overlap in _all(members, overlaps))


def _all(members: Int[np.ndarray, " k"], overlaps: PairOverlaps) -> list[float | None]:
    return [_with_centre(members, row, overlaps) for row in range(len(members))]


def _label(draw: ImageDraw.ImageDraw, at: tuple[int, int], height: int, photo_id: int, overlap: float | None) -> None:
    x, y = at
    box = (x, y, x + _WIDTH - 1, y + height - 1)
    colour = _BLUE if overlap is None else _RED if overlap < BAD else _INK
    if colour != _INK:
        draw.rectangle(box, outline=colour, width=_FRAME)
    told = "centre" if overlap is None else "not judged" if np.isnan(overlap) else f"overlap {overlap:.0%}"
    draw.text((x, y + height), f"photo {photo_id}, {told}", fill=colour, font=ImageFont.load_default(13))
