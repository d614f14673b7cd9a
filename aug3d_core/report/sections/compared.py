"""This version compared with the published one."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from aug3d_core.metrics.comparison import Comparison, Row, change_text, psnr_words
from aug3d_core.report.html import number, table, tag

_NOW = 1  # in a comparison of the published version with this one
_MOST_ROWS = 200


def beside_published(compared: Comparison | None) -> str:
    """Return the differences between the published version (the first run) and this one; empty without a comparison."""
    if compared is None:
        return ""
    parts = [tag("p", _said(compared)), _rows("Scores and cost", compared.headline)]
    for title, rows in (("Settings that differ", compared.params), ("Metrics that differ", compared.metrics)):
        shown = _rows(title, rows[:_MOST_ROWS]) if rows else ""
        parts.append(tag("details", tag("summary", f"{title}: {len(rows)}") + shown) if rows else "")
    return "".join(parts)


def _said(compared: Comparison) -> str:
    """Say which versions are compared, and whether their scores can be."""
    published = f"The published version is {tag('b', escape(compared.runs[0]))}."
    if compared.not_comparable:
        return f"{published} The scores cannot be compared: {escape(compared.not_comparable)}."
    words = psnr_words(compared, _NOW)
    told = f" This version against the published one: {escape(words)}." if words else ""
    return f"{published} Both were tested on the same photographs with the same rules.{told}"


def _rows(title: str, rows: Sequence[Row]) -> str:
    cells = [
        (escape(row.name), *(number(value) for value in row.values[: _NOW + 1]), change_text(row, _NOW), _verdict(row))
        for row in rows
    ]
    return table((escape(title), "published", "this version", "change", ""), cells, numeric=(1, 2, 3)) if cells else ""


def _verdict(row: Row) -> str:
    better = row.better[_NOW]
    if better is None:
        return ""
    return tag("span", "better", class_="ok") if better else tag("span", "worse", class_="refused")
