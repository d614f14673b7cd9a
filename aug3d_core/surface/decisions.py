"""What surface decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.run.stage import Decision


def decisions(metrics: Mapping[str, Any], reasons: Mapping[str, str]) -> Iterator[Decision]:
    """Yield the sizes of the mesh of all photographs, each with its reason."""
    spacing = metrics["baseline_point_spacing_gsd"]
    measured = "" if spacing is None else f"points {spacing:.2f} of a photograph's pixels apart"
    for name, reason in reasons.items():
        if (value := metrics.get(f"baseline_{name}")) is None:
            continue
        full = metrics.get(f"baseline_{name}_full")
        yield Decision(
            field=f"surface.{name}",
            value=value,
            measured="" if name == "texels" else measured,
            rule=reason,
            saves=f"{full - value:,.0f} of {full:,.0f}" if full else "",
        )
