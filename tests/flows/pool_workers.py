"""Workers of the pool that only Prefect's server knows: tests of one process share it, so each sets what is there."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any


async def only_these(client: Any, names: Collection[str]) -> None:
    """Let these workers be online, and no other."""
    from flows.pool import POOL, make_pool

    await make_pool(client)
    for worker in await client.read_workers_for_work_pool(POOL):
        if worker.name not in names:
            await client.request("DELETE", f"/work_pools/{POOL}/workers/{worker.name}")
    for name in names:
        await client.send_worker_heartbeat(POOL, name, heartbeat_interval_seconds=30)
