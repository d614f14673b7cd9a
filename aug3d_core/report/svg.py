"""Charts as inline SVG. Colours are the page's variables, so that they follow light and dark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from PIL import Image

from aug3d_core.report.html import data_uri
from aug3d_core.report.thumbnails import encoded

BAR_PX, VALUE_PX, WIDTH_PX = 30, 96, 624
LABEL_PX = 226  # the longest label in the larger writing of a phone
CHART_WIDTH, CHART_HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 420, 220, 52, 42, 12, 12


@dataclass(frozen=True)
class Bar:
    """One row of a bar chart; without a value it is drawn as missing."""

    label: str
    value: float | None
    text: str
    interval: tuple[float, float] | None = None
    main: bool = False


def bars(rows: Sequence[Bar], title: str) -> str:
    """Draw horizontal bars from zero, with whiskers where there is an interval."""
    known = [
        max(bar.value, *(bar.interval or ())) if bar.interval else bar.value for bar in rows if bar.value is not None
    ]
    scale = (WIDTH_PX - LABEL_PX - VALUE_PX) / max([*known, 1e-9])
    drawn = "".join(_bar(bar, i * BAR_PX, scale) for i, bar in enumerate(rows))
    return svg(WIDTH_PX, len(rows) * BAR_PX, title, drawn)


def _bar(bar: Bar, top: float, scale: float) -> str:
    middle = top + BAR_PX / 2
    end = LABEL_PX + scale * (bar.value or 0.0)
    kind = "main" if bar.main else "other"
    parts = [
        text(LABEL_PX - 10, middle, bar.label, "end", "label strong" if bar.main else "label"),
        f'<rect class="bar {kind}" x="{LABEL_PX}" y="{top + 5:.1f}" '
        f'width="{end - LABEL_PX:.1f}" height="{BAR_PX - 10}" rx="3"/>',
    ]
    if bar.interval is not None:
        low, high = (LABEL_PX + scale * limit for limit in bar.interval)
        parts.append(
            f'<path class="whisker" d="M{low:.1f} {middle}H{high:.1f}'
            f'M{low:.1f} {middle - 5}v10M{high:.1f} {middle - 5}v10"/>'
        )
        end = max(end, high)
    parts.append(text(end + 8, middle, bar.text, "start", "value strong" if bar.main else "value"))
    return "".join(parts)


def curve(points: Sequence[tuple[float, float]], title: str, along: str = "training step") -> str:
    """Draw one curve with its first and last step and its range of values. along: what it goes along."""
    finite = [(x, y) for x, y in points if math.isfinite(y)]
    if not finite:
        return ""
    xs, ys = [x for x, _ in finite], [y for _, y in finite]
    ticks = round_numbers(min(ys), max(ys))
    low, high = min(ticks[0], *ys), max(ticks[-1], *ys)
    x_scale = (CHART_WIDTH - LEFT - RIGHT) / max(max(xs) - min(xs), 1e-9)
    y_scale = (CHART_HEIGHT - TOP - BOTTOM) / max(high - low, 1e-12)
    base = CHART_HEIGHT - BOTTOM

    def place(x: float, y: float) -> str:
        return f"{LEFT + (x - min(xs)) * x_scale:.1f} {base - (y - low) * y_scale:.1f}"

    grid = "".join(level(base - (y - low) * y_scale, f"{y:.4g}") for y in ticks)
    steps = text(LEFT, base + 14, f"{min(xs):,.0f}", "start", "tick")
    steps += text(CHART_WIDTH - RIGHT, base + 14, f"{max(xs):,.0f}", "end", "tick")
    steps += text((LEFT + CHART_WIDTH) / 2, base + 31, along, "middle", "tick")
    line = f'<path class="line" d="M{"L".join(place(x, y) for x, y in finite)}"/>'
    end = place(xs[-1], ys[-1]).split()
    dot = f'<circle class="dot" cx="{end[0]}" cy="{end[1]}" r="3.5"/>'
    return svg(CHART_WIDTH, CHART_HEIGHT, title, grid + steps + line + dot)


def level(y: float, label: str) -> str:
    """Draw a line across a chart with its value at the left."""
    return f'<path class="grid" d="M{LEFT} {y:.1f}H{CHART_WIDTH - RIGHT}"/>' + text(LEFT - 6, y, label, "end", "tick")


def round_numbers(low: float, high: float) -> list[float]:
    """Return about four round numbers that span the range."""
    if high <= low:
        return [low, low + (abs(low) or 1.0)]
    rough = (high - low) / 4
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(m for m in (1, 2, 5, 10) if m * power >= rough)
    first = math.floor(low / step)
    return [step * i for i in range(first, math.ceil(high / step) + 1)]


def raster(size: tuple[int, int], image: Image.Image, kind: str, **options: int) -> str:
    """Return a picture that fills a drawing of this size; it is a file of this kind inside the page."""
    address = data_uri(f"image/{kind.lower()}", encoded(image, kind, **options))
    return f'<image href="{address}" width="{size[0]}" height="{size[1]}" preserveAspectRatio="none"/>'


def text(x: float, y: float, content: str, anchor: str, kind: str) -> str:
    """Write plain text about a point."""
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" dominant-baseline="central"'
    return f'<text class="{kind}" {place}>{escape(content)}</text>'


def svg(width: float, height: float, title: str, content: str) -> str:
    """Return a drawing that is as wide as its place allows; the title is read to those who do not see it."""
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(title)}">'
        f"<title>{escape(title)}</title>{content}</svg>"
    )
