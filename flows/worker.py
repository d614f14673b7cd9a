"""The worker: `python -m flows.worker` registers every scene and collection of the registry with Prefect, and runs what is due.

It looks at the registry again all the time, so that a scene that is added, changed or removed needs no restart. What a former
worker left half done, killed or with the machine, it starts again: finished steps are in the store.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Collection

from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.filters import DeploymentFilter, DeploymentFilterTags
from prefect.client.schemas.sorting import DeploymentSort

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import Aug3dError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each
from aug3d_core.scene_files.mirror import share
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.deployments import of_collection, of_everything, of_scene
from flows.pool import (
    BATCH,
    HOME_QUEUE,
    PHOTOGRAPHS,
    REGISTRIES,
    RUNS_AT_ONCE,
    PoolWorker,
    again_and_again,
    begin,
    machine,
    make_pool,
    make_queue,
    work_until_ended,
)
from flows.services import tell_ready
from flows.serving import queues_from
from flows.settings import COLLECTION, OURS, SCENE, home
from flows.takeover import on_all_pages, one_of_the_missed, take_over
from flows.watched_runs import watch_runs
from tasks.mlflow_outbox import waiting
from tasks.tracking import flush

_TELL_EVERY_S = 30.0

Entry = SceneEntry | CollectionEntry
Known = dict[str, Entry | str]  # what the registry says of a scene, or what is wrong with it
_OF_COLLECTION = f"{layout.COLLECTIONS}/"  # begins what is known of a collection: no scene has such a name


def main() -> None:
    """Work until told to end; what runs then goes on with the next worker."""
    asyncio.run(_work(begin(home())))


async def _work(store: Store) -> None:
    async with get_client() as client:
        await make_pool(client)
        await make_queue(client, machine(store))
        async for deployment in of_everything():
            await deployment.aapply()
        known = await register(store, None)
        await take_over(client, store)
        await one_of_the_missed(client, store)
    tell_ready(store.root)
    print(f"registered: {', '.join(known) or 'no scene yet'}", flush=True)
    workers = (
        PoolWorker(store, (*queues_from(os.environ), HOME_QUEUE), RUNS_AT_ONCE, own=True),
        PoolWorker(store, (BATCH, PHOTOGRAPHS), 2),  # one batch at a time, by its deployment
    )
    services = _watch_registry(store, known), tell_mlflow(store), watch_runs(store, workers)
    await work_until_ended(*services, *(worker.start() for worker in workers))


async def _watch_registry(store: Store, known: Known) -> None:
    async def look(_: PrefectClient) -> None:
        nonlocal known
        known = await register(store, known)

    await again_and_again(look)


async def tell_mlflow(store: Store) -> None:
    """Tell MLflow what it could not be told at its time, as soon as it can be reached again."""
    while True:
        if waiting(store):
            await asyncio.to_thread(flush, store)  # what comes of it stands in MLflow, or waits on
        await asyncio.sleep(_TELL_EVERY_S)


async def register(store: Store, known: Known | None) -> Known:
    """Bring Prefect's deployments to what the registry says; `known` is what it said before.

    A scene whose file is wrong keeps its deployment as it was: the file is named, and its runs say the same.
    """
    told: dict[str, Entry | Aug3dError] = {**read_each(store)}
    told |= {f"{_OF_COLLECTION}{name}": entry for name, entry in COLLECTIONS.read_each(store).items()}
    now: Known = {name: str(entry) if isinstance(entry, Aug3dError) else entry for name, entry in told.items()}
    if store.shared is not None and now != known:
        await asyncio.to_thread(share, store, store.shared.bucket, REGISTRIES)
    for name, entry in now.items():
        if known is not None and entry == known.get(name):
            continue
        try:
            if isinstance(entry, SceneEntry):
                await (await of_scene(name, entry)).aapply()
            elif isinstance(entry, CollectionEntry):
                await (await of_collection(name.removeprefix(_OF_COLLECTION), entry)).aapply()
            else:
                print(entry, flush=True)
        except Aug3dError as error:
            print(error, flush=True)
    if known is None or known.keys() - now.keys():
        await _remove_all_but(now)
    return now


async def _remove_all_but(known: Collection[str]) -> None:
    await _remove(SCENE, known)
    await _remove(COLLECTION, [name.removeprefix(_OF_COLLECTION) for name in known if name.startswith(_OF_COLLECTION)])


async def _remove(tag: str, names: Collection[str]) -> None:
    """Delete the deployments with a tag that have other names."""
    tagged = DeploymentFilter(tags=DeploymentFilterTags(all_=[OURS, tag]))
    async with get_client() as client:
        for deployment in await on_all_pages(
            lambda offset, limit: client.read_deployments(
                deployment_filter=tagged, sort=DeploymentSort.NAME_ASC, limit=limit, offset=offset
            )
        ):
            if deployment.name not in names:
                await client.delete_deployment(deployment.id)


if __name__ == "__main__":
    main()
