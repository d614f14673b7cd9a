"""What `--dry-run` tells: which steps of a run are in the store, and what the others will take on this machine."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.estimate.cost import Cost, Range
from aug3d_core.factory.estimate.estimate import PlanEstimate, estimate_plan
from aug3d_core.factory.estimate.room import check_room, size_words
from aug3d_core.factory.material import Material
from aug3d_core.factory.stages import GROUPING
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.store.scenes import records_before
from aug3d_core.store.store import Store
from flows.words import time_words, widened

_MIB = 2**20


def print_plan(store: Store, scene: str, material: Material, config: SceneConfig, as_json: bool) -> None:
    """Print the steps of a run with what each takes; raises TooLarge or StoreError if the run would be refused."""
    plan = tuple(planned(store, material, config))
    estimate = estimate_plan(store, material, config, plan)
    if not as_json:
        _print_table(scene, plan, estimate)
    check_room(store, scene, material, config, records_before(store, scene), plan)
    if as_json:
        print(json.dumps([_told(visit, estimate.steps[visit.step.name]) for visit in plan], indent=1))


def _told(visit: Visit, cost: Cost | None) -> dict[str, Any]:
    return {
        "stage": visit.step.name,
        "cached": cost is None,
        "seconds": cost and {end: round(getattr(cost.seconds, end), 1) for end in ("low", "likely", "high")},
        "peak_mib": cost and round(cost.peak_mib.likely),
        "disk_mib": cost and round(cost.disk_mib.likely, 1),
    }


def _print_table(scene: str, plan: Sequence[Visit], estimate: PlanEstimate) -> None:
    console = widened(Console())
    missing = sum(cost is not None for cost in estimate.steps.values())
    table = Table("stage", "state", title=f"{scene}: what a run would take here", show_footer=missing > 0)
    for heading in ("time", "at least", "at most", "memory", "disk"):
        table.add_column(heading, justify="right")
    for name, cost in estimate.steps.items():
        table.add_row(name, "compute" if cost else "cached", *_figures(cost))
    for column, text in zip(
        table.columns, ("together", f"{missing} to compute", *_figures(estimate.total)), strict=True
    ):
        column.footer = text
    console.print(table)
    if not missing:
        return
    console.print(f"estimated {estimate.told}", highlight=False, soft_wrap=True)
    if estimate.open_fields:
        console.print(
            f"{len(estimate.open_fields)} settings are decided from the scene later; they count as most scenes have them",
            highlight=False,
            soft_wrap=True,
        )
    if any(visit.step.name == GROUPING.name and visit.record is None for visit in plan):
        counted = f"; {estimate.folds} folds are counted" if estimate.folds > 1 else ""
        print(f"\na scene that turns out to be small is made in folds: from grouping on once for each{counted}")


def _figures(cost: Cost | None) -> tuple[str, ...]:
    if cost is None:
        return ("-",) * 5
    times = (cost.seconds.likely, cost.seconds.low, cost.seconds.high)
    return (*map(time_words, times), _size(cost.peak_mib), _size(cost.disk_mib))


def _size(mib: Range) -> str:
    return size_words(max(mib.likely, 1) * _MIB)
