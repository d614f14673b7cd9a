"""The plan of a run: what is in the store already, and whether the rest fits on the disk.

The command line makes it before Prefect is started. The flow then finds it here and does not make it again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.disk_estimate import check_room
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_plan: ContextVar[Sequence[Visit] | None] = ContextVar("plan", default=None)


def checked_plan(
    store: Store, scene: str, material: Material, config: SceneConfig, before: Mapping[str, Record]
) -> Sequence[Visit]:
    """Return the plan of a run; raises StoreError if the run does not fit on the disk. before: the last version, by step."""
    if (known := _plan.get()) is not None:
        return known
    plan = tuple(planned(store, material, config))
    check_room(store, scene, material, config, before, [(visit.step, visit.record) for visit in plan])
    return plan


@contextmanager
def following(plan: Sequence[Visit]) -> Iterator[None]:
    """Have the flow that is started inside the block follow a plan. The store must be in use all the while."""
    token = _plan.set(plan)
    try:
        yield
    finally:
        _plan.reset(token)
