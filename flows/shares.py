"""Workers of other machines that make cells of a study too: each in a flow run of its own, which the study starts and ends."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from uuid import UUID

from prefect.client.orchestration import get_client
from prefect.deployments import run_deployment
from prefect.runtime import deployment, flow_run

from aug3d_core.store.store import Store
from flows.pool import ONLINE, POOL, machine, machine_of, queues_of
from flows.serving import CPU
from flows.takeover import cancel_all_started

SHARE = "share of a study"  # name of the flow
DEPLOYED = "for a worker"  # and of its deployment


@contextmanager
def shared_out(store: Store) -> Iterator[None]:
    """Let each other machine that takes runs make cells of the present study too, while the block runs."""
    if store.shared is None or not deployment.id:
        yield
        return
    study = str(flow_run.id)
    try:
        for other in _others(store):
            run_deployment(
                f"{SHARE}/{DEPLOYED}",
                parameters={"study": study},
                timeout=0,
                work_queue_name=other,
                idempotency_key=f"{study} {other}",  # a study that is taken over finds those that it began
            )
        yield
    finally:
        asyncio.run(cancel_all_started(UUID(study)))  # all cells are there, or nobody reads them


def _others(store: Store) -> list[str]:
    """Return which other machines take runs that any can do."""
    with get_client(sync_client=True) as client:
        workers = client.read_workers_for_work_pool(POOL)
    online = (worker.name for worker in workers if worker.status == ONLINE)
    takers = {machine_of(name) for name in online if CPU in queues_of(name)}
    return sorted(takers - {machine(store)})
