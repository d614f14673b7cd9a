"""Pieces of HTML: escaped text, formatted numbers, tables, embedded pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from PIL import Image

from aug3d_core.report.report_style import STYLE
from aug3d_core.report.thumbnails import encoded

KEEP_BYTES = 100_000  # smaller pictures are embedded unchanged: compression would blur the lines of plots
PICTURE_PX = 1280
WEBP_QUALITY = 74


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
    """Return a figure with the picture embedded; animations (WebP) stay animated."""
    with Image.open(path) as image:
        image.load()
        moves, small = getattr(image, "is_animated", False), path.stat().st_size <= KEEP_BYTES
        if moves or (small and image.format in ("PNG", "WEBP")):
            kind, data, size = str(image.format).lower(), path.read_bytes(), image.size
        else:
            copy = image.convert("RGB")
            copy.thumbnail((longest_px, longest_px))
            kind, data, size = "webp", encoded(copy, "WEBP", quality=WEBP_QUALITY), copy.size
    width, height = map(str, size)  # given, so that the layout does not jump while it is decoded
    image_tag = (
        f'<img src="{data_uri(kind, data)}" alt="{escape(caption)}" width="{width}" height="{height}" decoding="async">'
    )
    return tag("figure", image_tag + tag("figcaption", escape(caption)))


def data_uri(kind: str, data: bytes) -> str:
    """Return a picture as a data URI."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
