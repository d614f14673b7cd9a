"""Shards over a Dask cluster: workers of the scheduler that AUG3D_DASK names help with stages that take this machine long.

Only an order goes to the scheduler: which object is made, of which others, by which settings. What a worker makes of it goes
to the shared store, where the machine that makes the object finds it. A worker that is lost costs the shards it was at.
"""

from __future__ import annotations

import os
from typing import Any

from aug3d_core.factory.build import Built, Work, assist, work_of
from aug3d_core.factory.material import source_of
from aug3d_core.factory.scheduler import asking, obey, scheduler_from
from aug3d_core.factory.stages import STAGES
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.stage import Frozen
from aug3d_core.store.store import Store

ASK_AFTER_S = 10.0  # a stage that ends before has no use for help, which takes seconds to begin


class Order(Frozen):
    """An object whose shards are wanted. inputs: stage and key of each object that it is made of, by name."""

    stage: str
    key: str
    config: dict[str, Any]
    inputs: dict[str, tuple[str, str]]


def order_of(work: Work) -> Order | None:
    """Return the order for an object; None if it is made of what is in no store."""
    made = {name: source.made for name, source in work.sources.items()}
    return Order(
        stage=work.stage.name,
        key=work.key,
        config=work.config.model_dump(mode="json"),
        inputs={name: (record.stage, record.key) for name, record in made.items() if record},
    ) if all(made.values()) else None  # fmt: skip


def ordered(store: Store, order: Order) -> Work:
    """Return what an order is about, with its inputs in this store; raises an error where it would be another object here."""
    stage = STAGES[order.stage]
    sources = {}
    for name, (made_by, key) in order.inputs.items():
        if (record := store.find(made_by, key)) is None:
            raise StoreError(f"{made_by} {key} is not in {store.root}, nor in the shared store", "run the scene again")
        sources[name] = source_of(store, record, stage.reads.get(name, ()))
    work = work_of(stage, stage.config.model_validate(order.config), sources)
    if work.key != order.key:
        raise UsageError(
            f"{order.stage} would be {work.key} here, not {order.key}",
            "install the same versions of aug3d and its engines on all machines",
        )
    return work


def with_cluster(store: Store, make: Make) -> Make:
    """Return what makes a step and, while that takes long, has the workers of a Dask cluster make shards of it.

    Without AUG3D_DASK it is `make`. Raises UsageError where the address cannot be used.
    """
    address = scheduler_from(os.environ)
    if not address or store.shared is None:
        return make

    def made(visit: Visit) -> Built | None:
        order = order_of(visit.work) if visit.work and visit.step.stage.assist else None
        if order is None:
            return make(visit)
        with asking(__name__, order.model_dump_json(), address, ASK_AFTER_S):
            return make(visit)

    return made


def _assist(store: Store, order: str) -> None:
    assist(store, ordered(store, Order.model_validate_json(order)), lambda *_: None)


if __name__ == "__main__":
    obey(_assist)
