"""`python -m flows.joined_worker`: a worker of another machine's Prefect server, with a home of its own and a shared store.

It knows the scenes from the shared store, and registers none.
"""

from __future__ import annotations

import asyncio
import os
from functools import partial

from prefect.client.orchestration import get_client

from aug3d_core.scene_files.mirror import bring
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store
from flows.pool import (
    REGISTRIES,
    RUNS_AT_ONCE,
    PoolWorker,
    begin,
    machine,
    make_queue,
    work_until_ended,
)
from flows.services import tell_ready
from flows.serving import queues_from
from flows.settings import home
from flows.takeover import take_over
from flows.watched_runs import watch_runs
from flows.worker import tell_mlflow


def main() -> None:
    """Work until told to end; what runs then goes on with another worker."""
    store = begin(home())
    assert store.shared is not None
    asyncio.run(_work(store, store.shared.bucket))


async def _work(store: Store, bucket: Bucket) -> None:
    async with get_client() as client:
        await make_queue(client, machine(store))
        await take_over(client, store)
    queues, begin_with = queues_from(os.environ), partial(bring, store, bucket, REGISTRIES)
    worker = PoolWorker(store, queues, RUNS_AT_ONCE, own=True, before=begin_with)
    tell_ready(store.root)
    print(f"{worker.name} takes runs", flush=True)
    await work_until_ended(worker.start(), tell_mlflow(store), watch_runs(store, (worker,)))


if __name__ == "__main__":
    main()
