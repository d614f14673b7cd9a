"""What sampling decides by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.run.stage import AS_SET, Decision


def decisions(metrics: Mapping[str, Any], config: SamplingConfig) -> Iterator[Decision]:
    """Yield how many virtual views there are, and how much ground they show."""
    planned, uniform = metrics["views_planned"], metrics["uniform_views"]
    by_coverage = config.choice == "coverage"
    yield Decision(
        field="sampling.views",
        value=planned,
        measured=f"they reach {metrics['reach_share']:.0%} of surface and directions,"
        f" {uniform:.0f} by uniform sampling {metrics['uniform_reach_share']:.0%}"
        if by_coverage and uniform
        else "as many as found a place",
        rule=f"the rest adds too little (sampling.min_gain {config.min_gain})" if by_coverage else AS_SET,
        saves=f"{uniform - planned:.0f} of {uniform:.0f} views" if planned and uniform > planned else "",
    )
    finest, coarsest = metrics["cell_finest_world_units"], metrics["cell_coarsest_world_units"]
    if finest is not None:
        yield Decision(
            field="sampling.scales",
            value=f"{finest:,.1f} to {coarsest:,.1f} across",
            measured=f"views are {metrics['sampling_over_finest_ratio']:.2f} times as coarse as photographs justify",
            rule="no finer than the photographs, no coarser than the scene",
        )
