"""What depth decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.run.stage import Decision


def decisions(metrics: Mapping[str, Any]) -> Iterator[Decision]:
    """Yield the number of planes of a sweep, and what was not made again."""
    if metrics.get("planes_median"):
        yield Decision(
            field="depth.planes",
            value=metrics["planes_median"],
            measured="the span of depths that sparse points show in each photograph",
            rule=metrics["planes_reason"],
        )
    if metrics["photos_reused"]:
        yield Decision(
            field="depth.maps",
            value=f"{metrics['photos_reused']} of {metrics['photos']} kept",
            measured="",
            rule="a map that would come out the same is not made again",
        )
