"""Histograms as inline SVG: how often each size comes, with the median."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aug3d_core.report.svg import BOTTOM, CHART_HEIGHT, CHART_WIDTH, LEFT, RIGHT, TOP, level, round_numbers, svg, text

_BINS = 24
_SHOWN = 0.99  # of the values; what lies beyond is counted in the last bin


def histogram(values: np.ndarray, what: str, of: str) -> str:
    """Draw how many values there are of each size, zero at the left; empty without a finite one.

    what: the name of the size with its unit; of: what is counted. The last bar holds the largest too, up to a hundredth.
    """
    finite = np.asarray(values, float)[np.isfinite(values)]
    if not len(finite):
        return ""
    most = float(np.quantile(finite, _SHOWN)) or float(finite.max()) or 1.0
    ticks = round_numbers(0.0, most)
    step = (ticks[1] - ticks[0]) / math.ceil(_BINS / (len(ticks) - 1))
    bins = math.ceil(most / step - 1e-9)
    counts = np.bincount(np.minimum(finite / step, bins - 1).astype(int), minlength=bins)
    labels = [(tick / step, f"{tick:g}") for tick in np.round(ticks, 10) if tick <= bins * step * 1.001]
    return _drawn(counts, labels, what, of, float(np.median(finite)) / step, f"median {np.median(finite):.3g}")


def count_histogram(counts: Mapping[int, int], what: str, of: str) -> str:
    """Draw a bar for each whole number, as high as its count; the last one stands for all above it too."""
    *names, last = counts
    labels = [(i + 0.5, name) for i, name in enumerate([*map(str, names), f"{last}+"])]
    return _drawn(np.array([*counts.values()]), labels, what, of, None, "") if any(counts.values()) else ""


def _drawn(
    counts: np.ndarray,
    labels: Sequence[tuple[float, str]],
    what: str,
    of: str,
    mark: float | None,
    mark_text: str,
) -> str:
    """Draw bars one beside the other; labels and mark stand at their distance from the left, in bars."""
    most = 1.06 * float(counts.max())
    ticks = [tick for tick in round_numbers(0, most) if tick == int(tick) and tick <= most]
    base, wide = CHART_HEIGHT - BOTTOM, (CHART_WIDTH - LEFT - RIGHT) / len(counts)
    tall = (base - TOP) / most
    parts = [level(base - tick * tall, f"{tick:,.0f}") for tick in ticks]
    for i, count in enumerate(counts):
        parts.append(
            f'<rect class="bar main" x="{LEFT + i * wide + 0.5:.1f}" y="{base - count * tall:.1f}"'
            f' width="{max(wide - 1, 0.5):.1f}" height="{count * tall:.1f}"/>'
        )
    parts += [text(LEFT + at * wide, base + 13, label, "middle", "tick") for at, label in labels]
    if mark is not None and mark <= len(counts):
        x = LEFT + mark * wide
        parts.append(f'<path class="whisker" d="M{x:.1f} {TOP}V{base}"/>')
        side, anchor = (6, "start") if mark < len(counts) / 2 else (-6, "end")
        parts.append(text(x + side, TOP + 6, mark_text, anchor, "tick strong"))
    parts.append(text((LEFT + CHART_WIDTH - RIGHT) / 2, base + 31, what, "middle", "tick"))
    return svg(CHART_WIDTH, CHART_HEIGHT, f"{of} by {what}", "".join(parts))
