"""Pieces of HTML: escaped text, numbers as people read them, tables, pictures inside the page."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from aug3d_core.charts.thumbnails import thumbnail_jpeg

KEEP_PNG_BYTES = 150_000  # plots of this size stay as they are: JPEG would blur their lines
PICTURE_PX = 1400


def tag(name: str, content: str = "", **attributes: str) -> str:
    """Return an element; content is HTML already, attribute `class_` becomes `class`."""
    written = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items())
    return f"<{name}{written}>{content}</{name}>"


def number(value: Any, digits: int = 4) -> str:
    """Return a figure as text: significant digits, thousands apart, a dash for what is missing."""
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
    """Return a time as people say it."""
    if seconds < 100:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def spaced(name: str) -> str:
    """Return an identifier as words."""
    return escape(name.replace("_", " "))


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], numeric: Iterable[int] = ()) -> str:
    """Return a table whose cells are HTML already; `numeric` names the columns set to the right."""
    right = set(numeric)
    kind = ["num" if i in right else "txt" for i in range(len(heads))]
    head = "".join(tag("th", cell, class_=k) for cell, k in zip(heads, kind, strict=True))
    body = "".join(
        tag("tr", "".join(tag("td", cell, class_=k) for cell, k in zip(row, kind, strict=True))) for row in rows
    )
    return tag("div", tag("table", tag("thead", tag("tr", head)) + tag("tbody", body)), class_="scroll")


def picture(path: Path, caption: str) -> str:
    """Return a figure with the picture inside the page."""
    if path.suffix == ".png" and path.stat().st_size <= KEEP_PNG_BYTES:
        kind, data = "png", path.read_bytes()
    else:
        kind, data = "jpeg", thumbnail_jpeg(path, PICTURE_PX)
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    image = f'<img src="{source}" alt="{escape(caption)}">'
    return tag("figure", image + tag("figcaption", escape(caption)))
