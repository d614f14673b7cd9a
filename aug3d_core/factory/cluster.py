"""Shards over a Dask cluster: workers of the scheduler that AUG3D_DASK names help with stages that take this machine long.

Only an order goes to the scheduler: which object is made, of which others, by which settings. What a worker makes of it goes
to the shared store, where the machine that makes the object finds it. A worker that is lost costs the shards it was at.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from aug3d_core.factory.build import Built, Work, assist, work_of
from aug3d_core.factory.material import source_of
from aug3d_core.factory.scheduler import CONNECT_S, scheduler_from
from aug3d_core.factory.stages import STAGES
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.run.errors import Aug3dError, StoreError, UsageError
from aug3d_core.run.linux_process import die_with_parent
from aug3d_core.run.stage import Frozen
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.store import Store

if TYPE_CHECKING:
    from distributed import Client, Future

ASK_AFTER_S = 10.0  # a stage that ends before has no use for help, which takes seconds to begin
ASK_EVERY_S = 30.0  # workers join and leave
_log = logging.getLogger(__name__)


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
        with asking(order, address):
            return make(visit)

    return made


@contextmanager
def asking(order: Order, address: str) -> Iterator[None]:
    """Ask each worker of a cluster for help with an object, while the block runs. Without a cluster it runs without help."""
    over = Event()
    asking = Thread(target=_ask, args=(order, address, over), daemon=True)
    asking.start()
    try:
        yield
    finally:
        over.set()
        asking.join()


def _ask(order: Order, address: str, over: Event) -> None:
    if over.wait(ASK_AFTER_S):
        return
    try:
        from distributed import Client

        with Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            _keep_asking(client, order, over)
    except Exception as error:  # whatever a cluster may do, the object is made here
        _log.warning("no help from %s: %s: %s", address, type(error).__name__, error)


def _keep_asking(client: Client, order: Order, over: Event) -> None:
    asked: dict[str, Future] = {}
    told = set[str]()
    while True:
        for worker in client.scheduler_info(n_workers=-1)["workers"].keys() - asked.keys():
            asked[worker] = client.submit(help_with, order.model_dump_json(), workers=[worker], pure=False, retries=0)
        if over.wait(ASK_EVERY_S):
            break
        for worker, future in asked.items():
            if future.status == "error" and worker not in told:
                told.add(worker)
                _log.warning("no help from %s: %s", worker, future.exception())
    client.cancel(list(asked.values()), force=True)  # those not begun; the others end with the last shard


def help_with(order: str) -> None:
    """Make shards of what is ordered, on a worker of Dask's: in a process of its own, which may start others."""
    command = [sys.executable, "-m", "aug3d_core.factory.cluster"]
    done = subprocess.run(command, input=order, capture_output=True, text=True, preexec_fn=die_with_parent)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise RuntimeError(lines[-1])


def main() -> None:
    """Make shards of the order on standard input, in this machine's home and the shared store."""
    order = Order.model_validate_json(sys.stdin.read())
    try:
        store = Store(Path(os.environ.get("AUG3D_HOME", "aug3d_data")))
        if store.shared is None:
            raise UsageError(
                f"{SHARED_VARIABLE} is not set on this machine", "start Dask's workers with it and its keys"
            )
        with store.using():
            assist(store, ordered(store, order), lambda *_: None)
    except Aug3dError as error:
        sys.exit(f"{error.problem} -> {error.remedy}")


if __name__ == "__main__":
    main()
