"""The plan of a run: what is in the store already, whether that is all, and whether the rest fits on this machine.

The command line makes it before Prefect is started. The flow then finds it here and does not make it again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.estimate.estimate import estimate_plan
from aug3d_core.factory.estimate.room import check_room
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.run.errors import InputError
from aug3d_core.store import layout
from aug3d_core.store.code_version import code_version
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import bring_report, paths_here, records_of, report_fault, version_metrics, versions
from aug3d_core.store.store import Store
from tasks.mlflow_outbox import waiting

_plan: ContextVar[Sequence[Visit] | None] = ContextVar("plan", default=None)


def checked_plan(
    store: Store, scene: str, material: Material, config: SceneConfig, before: Mapping[str, Record]
) -> Sequence[Visit]:
    """Return the plan of a run; raises StoreError or TooLarge if it does not fit here. before: the last version, by step."""
    if (known := _plan.get()) is not None:
        return known
    plan = tuple(planned(store, material, config))
    check_room(store, scene, material, config, before, plan)
    return plan


def expected_times(store: Store, material: Material, config: SceneConfig, plan: Sequence[Visit]) -> dict[str, float]:
    """Return what the missing steps of a run will likely take [s]; none where the photographs cannot be read.

    No work is done to know this machine: what the run takes will tell.
    """
    try:
        steps = estimate_plan(store, material, config, plan, timed=False).steps
    except InputError:
        return {}
    return {name: cost.seconds.likely for name, cost in steps.items() if cost}


def made_of_the_same(store: Store, scene: str, plan: Sequence[Visit]) -> Path | None:
    """Return a scene's newest version if it is made of what the plan finds, and nothing is missing."""
    newest = versions(store, scene)[-1:]
    if not newest or any(visit.record is None for visit in plan):
        return None
    records = records_of(store, version_metrics(newest[0]))
    made = {step: record.key for step, record in records.items()}
    return newest[0] if made == {visit.step.name: visit.record.key for visit in plan if visit.record} else None


def nothing_to_do(store: Store, scene: str, preset: str, plan: Sequence[Visit]) -> dict[str, Any] | None:
    """Return the `metrics.json` of a scene's newest version if a run would make the same again; None otherwise.

    It was made by the same code, its report and every file of its objects are as they were written, and the run that made it
    was not killed before MLflow and other machines knew.
    """
    version = made_of_the_same(store, scene, plan)
    if version is None or not (version / layout.TOLD).exists() or waiting(store):
        return None
    metrics = version_metrics(version)
    if (metrics["preset"], metrics["git"]) != (preset, code_version()) or report_fault(store, version):
        return None
    if not all(visit.record and store.whole(visit.record.stage, visit.record.key) for visit in plan):
        return None
    bring_report(store, version)
    stages = {name: {**figures, "cached": True} for name, figures in metrics["stages"].items()}
    return {**metrics, "stages": stages, "paths": paths_here(store, version, metrics)}


@contextmanager
def following(plan: Sequence[Visit]) -> Iterator[None]:
    """Have the flow that is started inside the block follow a plan. The store must be in use all the while."""
    token = _plan.set(plan)
    try:
        yield
    finally:
        _plan.reset(token)
