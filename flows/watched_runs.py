"""What a worker sees to beside its own runs: those that were cancelled unheard, that it lost, or whose worker died.

All runs at work are asked for once in every few seconds: an answer costs Prefect's server 30 ms of a processor.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from uuid import UUID

from prefect.client.orchestration import PrefectClient
from prefect.client.schemas.objects import FlowRun

from aug3d_core.store.store import Store
from flows.pool import WORKER, PoolWorker, again_and_again
from flows.takeover import AT_WORK, STARTED, end_cancelled, our_runs, put_back, take_over_from_others
from tasks.run_locks import has_process

STRANDED_S = 60.0  # a run is begun within seconds


class Stranded:
    """The runs of this process's workers that they do not execute, and since when that was seen.

    Prefect takes them for being at work: their worker lives, but lost them with a server.
    """

    def __init__(self, store: Store, workers: Sequence[PoolWorker]) -> None:
        self._store, self._workers = store, workers
        self._since: dict[tuple[UUID, UUID | None], float] = {}

    async def look(self, client: PrefectClient, runs: Sequence[FlowRun]) -> None:
        """Put back in line what has been so for long, of the runs that are at work."""
        names = {worker.name for worker in self._workers}
        executed = {run for worker in self._workers for run in worker.executed}
        now, before, self._since = time.monotonic(), self._since, {}
        for run in runs:
            ours = run.state_type in STARTED and run.labels.get(WORKER) in names and run.id not in executed
            if not ours or has_process(self._store.root, str(run.id)):
                continue
            since = before.get((run.id, run.state_id), now)
            if now - since >= STRANDED_S:
                await put_back(client, run.id)
            else:
                self._since[run.id, run.state_id] = since


async def watch_runs(store: Store, workers: Sequence[PoolWorker]) -> None:
    """Look at the runs at work again and again, and see to those that nobody else sees to.

    Where machines share a store, that is also what workers of other machines left when they died.
    """
    stranded, watch = Stranded(store, workers), None
    if store.shared is not None:
        from aug3d_core.store.lease import Watch

        watch = Watch(store.shared.bucket)

    async def look(client: PrefectClient) -> None:
        runs = await our_runs(client, store, *AT_WORK)
        await end_cancelled(client, store, runs)
        await stranded.look(client, runs)
        if watch is not None:
            await take_over_from_others(client, watch, runs)

    await again_and_again(look)
