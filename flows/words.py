"""Figures, times and requests as people read them, and the room that tables of them have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

_MINUTE_S, _HOUR_S, _DAY_S = 60, 3600, 86_400
_LOG_WIDTH = 140  # characters


def figure(value: float | int | str | bool | None) -> str:
    """Return a metric as people write it."""
    return f"{value:.4g}" if isinstance(value, float) else "-" if value is None else str(value)


def time_words(seconds: float) -> str:
    """Return a time as people read it."""
    if seconds < 2 * _MINUTE_S:
        return f"{max(seconds, 1):.0f} s"
    if seconds < 2 * _HOUR_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    return f"{seconds / _HOUR_S:.1f} h" if seconds < 2 * _DAY_S else f"{seconds / _DAY_S:.0f} days"


def traffic_words(told: Mapping[str, Any]) -> str:
    """Return what a run asked of the shared store, in words."""
    kinds = ", ".join(f"{kind} {count:,}" for kind, count in told["requests"].items())
    asked = f"{sum(told['requests'].values()):,} requests ({kinds})" if kinds else "no request"
    return f"{asked}, {told['mib_up']:,.1f} MiB up, {told['mib_down']:,.1f} MiB down"


def widened(console: Console) -> Console:
    """Return the console itself, with room for tables where its output is no terminal: a log has no width of its own."""
    if not console.is_terminal:
        console.width = max(console.width, _LOG_WIDTH)
    return console
