"""Pieces of HTML: escaped text, formatted numbers, tables, embedded pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from PIL import Image

from aug3d_core.report.report_style import STYLE
from aug3d_core.report.thumbnails import encoded, is_film

KEEP_BYTES = 100_000  # smaller pictures are embedded unchanged: compression would blur the lines of plots
PICTURE_PX = 1600  # sheets of many pictures have small writing, which must be there when they are enlarged
JPEG_QUALITY = 72  # browsers put JPEG into a PDF as it is; of WebP they make pixels, seven times as many bytes
_SHEET_PX, _STRIP_PX = 1500, 1000  # as wide: a sheet of many pictures, or if half as high or less, a strip of some


def tag(name: str, content: str = "", **attributes: str) -> str:
    """Return an element; content is HTML already, attribute `class_` becomes `class`."""
    written = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items())
    return f"<{name}{written}>{content}</{name}>"


def number(value: Any, digits: int = 4) -> str:
    """Return a value as text: significant digits, thousands separators, a dash if it is missing."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"
    return escape(str(value))


def duration(seconds: float) -> str:
    """Return a time as text."""
    if seconds < 100:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def percent(share: float | None, digits: int = 0) -> str:
    """Return a share (0 to 1) in percent; a dash if it is missing; small values are never shown as zero."""
    if share is None:
        return "-"
    least = 0.5 * 10.0**-digits
    return f"under {2 * least:g} %" if 0 < 100 * share < least else f"{100 * share:.{digits}f} %"


def spaced(name: str) -> str:
    """Return an identifier as words."""
    return escape(name.replace("_", " "))


def page(title: str, content: str, head: str = "", end: str = "") -> str:
    """Return a whole page that needs no network; title is plain text, head and end are additional HTML."""
    meta = '<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1">'
    head = meta + tag("title", escape(title)) + tag("style", STYLE) + head
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{tag("main", content)}{end}</body></html>\n'


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], numeric: Iterable[int] = ()) -> str:
    """Return a table whose cells are HTML already; `numeric` lists the right-aligned columns."""
    right = set(numeric)
    kind = ["num" if i in right else "txt" for i in range(len(heads))]
    head = "".join(tag("th", cell, class_=k) for cell, k in zip(heads, kind, strict=True))
    body = "".join(
        tag("tr", "".join(tag("td", cell, class_=k) for cell, k in zip(row, kind, strict=True))) for row in rows
    )
    return tag("div", tag("table", tag("thead", tag("tr", head)) + tag("tbody", body)), class_="scroll")


def picture(path: Path, caption: str, longest_px: int = PICTURE_PX) -> str:
    """Return a figure with the picture embedded; a film (WebM) is played over and over."""
    if is_film(path):
        film = tag(
            "video", src=data_uri("video/webm", path.read_bytes()), controls="", loop="", autoplay="", muted="",
            playsinline="", title=caption,
        )  # fmt: skip
        return tag("figure", film + tag("figcaption", escape(caption)))
    image_tag = _image(path, caption, longest_px)
    return tag("figure", image_tag + tag("figcaption", escape(caption)), class_=_figure(path))


def _figure(path: Path) -> str:
    """Return the class of a picture's figure: sheets of many pictures take the whole width of the page."""
    with Image.open(path) as image:
        width, height = image.size
    return "large" if width >= _SHEET_PX or (width >= _STRIP_PX and width >= 2 * height) else "small"


def slider(above: Path, below: Path, caption: str, of_above: str, of_below: str) -> str:
    """Return a figure of two pictures of one size, of which a slider shows the left of one and the right of the other.

    The page needs the script of the report; without it both halves stay as wide.
    """
    handle = f'<input type="range" min="0" max="100" value="50" aria-label="{escape(caption)}">'
    named = tag("span", escape(of_above), class_="left") + tag("span", escape(of_below), class_="right")
    both = _image(below, of_below, PICTURE_PX) + _image(above, of_above, PICTURE_PX)
    return tag("figure", tag("div", both + named + handle, class_="slider") + tag("figcaption", escape(caption)))


def _image(path: Path, caption: str, longest_px: int) -> str:
    with Image.open(path) as image:
        image.load()
        if path.stat().st_size <= KEEP_BYTES and image.format in ("PNG", "WEBP"):
            kind, data, size = str(image.format).lower(), path.read_bytes(), image.size
        else:
            copy = image.convert("RGB")
            copy.thumbnail((longest_px, longest_px))
            kind, data, size = "jpeg", encoded(copy, "JPEG", quality=JPEG_QUALITY), copy.size
    width, height = map(str, size)  # given, so that the layout does not jump while it is decoded
    source = data_uri(f"image/{kind}", data)
    return f'<img src="{source}" alt="{escape(caption)}" width="{width}" height="{height}" decoding="async">'


def data_uri(kind: str, data: bytes) -> str:
    """Return data of a media type as a URI."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
