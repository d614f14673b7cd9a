"""Runs that Prefect takes for being at work, and that nobody works on: their worker lives, but lost them with a server."""

from __future__ import annotations

import time
from collections.abc import Sequence
from uuid import UUID

from prefect.client.orchestration import PrefectClient

from aug3d_core.store.store import Store
from flows.pool import WORKER, PoolWorker, again_and_again
from flows.takeover import STARTED, our_runs, put_back
from tasks.run_locks import has_process

STRANDED_S = 60.0  # a run is begun within seconds


class Stranded:
    """The runs of this process's workers that they do not execute, and since when that was seen."""

    def __init__(self, store: Store, workers: Sequence[PoolWorker]) -> None:
        self._store, self._workers = store, workers
        self._since: dict[tuple[UUID, UUID | None], float] = {}

    async def look(self, client: PrefectClient) -> None:
        """Put back in line what has been so for long."""
        names = {worker.name for worker in self._workers}
        executed = {run for worker in self._workers for run in worker.executed}
        now, before, self._since = time.monotonic(), self._since, {}
        for run in await our_runs(client, self._store, *STARTED):
            ours = run.labels.get(WORKER) in names and run.id not in executed
            if not ours or has_process(self._store.root, str(run.id)):
                continue
            since = before.get((run.id, run.state_id), now)
            if now - since >= STRANDED_S:
                await put_back(client, run.id)
            else:
                self._since[run.id, run.state_id] = since


async def watch_stranded(store: Store, workers: Sequence[PoolWorker]) -> None:
    """Look for such runs again and again."""
    await again_and_again(Stranded(store, workers).look)
