"""The worker: `python -m flows.worker` registers every scene and collection of the registry with Prefect, and runs what is due.

It looks at the registry again all the time, so that a scene that is added, changed or removed needs no restart. What a former
worker left half done, killed or with the machine, it starts again: finished steps are in the store.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import Awaitable, Callable, Collection
from datetime import UTC, datetime, timedelta
from typing import TypeVar

import psutil
from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.filters import (
    DeploymentFilter,
    DeploymentFilterTags,
    FlowRunFilter,
    FlowRunFilterExpectedStartTime,
    FlowRunFilterState,
    FlowRunFilterStateType,
    FlowRunFilterTags,
)
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.client.schemas.sorting import DeploymentSort, FlowRunSort
from prefect.states import AwaitingRetry, Cancelled, Crashed
from prefect.types import DateTime

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.deployments import COLLECTION, SCENE, of_collection, of_everything, of_scene
from flows.pool import BATCH, CPU, GPU, HOME, PoolWorker, make_pool
from flows.services import tell_ready
from flows.settings import OURS, home
from tasks.mlflow_outbox import waiting
from tasks.run_locks import has_process
from tasks.tracking import flush

RUNS_AT_ONCE = 2  # rendering and training take turns besides, whatever runs
_LOOK_EVERY_S = 5.0
_TELL_EVERY_S = 30.0
CANCELLED_WITHIN_S = 30.0
_PAGE = 200  # the most that Prefect tells at a time

T = TypeVar("T")
Entry = SceneEntry | CollectionEntry
Known = dict[str, Entry | str]  # what the registry says of a scene, or what is wrong with it
_OF_COLLECTION = f"{layout.COLLECTIONS}/"  # begins what is known of a collection: no scene has such a name


def main() -> None:
    """Work until told to end; what runs then goes on with the next worker."""
    if os.environ.get(SUPERVISED):
        die_with_parent()
    store = Store(home())
    store.check_writable()
    asyncio.run(_work(store))


async def _work(store: Store) -> None:
    async with get_client() as client:
        await make_pool(client)
        async for deployment in of_everything():
            await deployment.aapply()
        known = await register(store, None)
        await take_over(client, store)
        await one_of_the_missed(client, store)
    tell_ready(store.root)
    print(f"registered: {', '.join(known) or 'no scene yet'}", flush=True)
    workers = PoolWorker(store.root, (CPU, GPU, HOME), RUNS_AT_ONCE), PoolWorker(store.root, (BATCH,), 1)
    tasks = [asyncio.create_task(work) for work in (_watch(store, known), _tell_mlflow(store))]
    tasks += [asyncio.create_task(worker.start()) for worker in workers]
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _end)
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        if task.done():
            task.result()


def _end(*_: object) -> None:
    """Kill what runs: its runs stay where they are, and the next worker takes them over."""
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            child.kill()
    os._exit(0)


async def _watch(store: Store, known: Known) -> None:
    async with get_client() as client:
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            known = await register(store, known)
            await end_cancelled(client, store)


async def _tell_mlflow(store: Store) -> None:
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
        for deployment in await _all(
            lambda offset: client.read_deployments(
                deployment_filter=tagged, sort=DeploymentSort.NAME_ASC, limit=_PAGE, offset=offset
            )
        ):
            if deployment.name not in names:
                await client.delete_deployment(deployment.id)


async def take_over(client: PrefectClient, store: Store) -> None:
    """Put runs that no process works on back in line; end those that were being cancelled, and parts of others."""
    for run in await _runs(client, store, StateType.RUNNING, StateType.PENDING, StateType.CANCELLING):
        if has_process(store.root, str(run.id)):
            continue
        if run.state_type == StateType.CANCELLING:
            state = Cancelled(message="its process has ended")
        elif run.deployment_id is None:  # a part of another run, or started in a terminal
            state = Crashed(message="its process has ended; whoever started it can start it again")
        else:
            state = AwaitingRetry(message="its process ended before it did; finished steps are not made again")
        await client.set_flow_run_state(run.id, state, force=True)


async def end_cancelled(client: PrefectClient, store: Store) -> None:
    """End what Prefect's own worker should have: it no longer hears of cancelling once Prefect was away for some seconds."""
    for run in await _runs(client, store, StateType.CANCELLING):
        if run.state and run.state.timestamp > datetime.now(UTC) - timedelta(seconds=CANCELLED_WITHIN_S):
            continue
        for child in psutil.Process().children():
            with contextlib.suppress(psutil.Error):
                if child.environ().get("PREFECT__FLOW_RUN_ID") == str(run.id):
                    child.kill()  # its stage dies with it
        await client.set_flow_run_state(run.id, Cancelled(message="cancelled"), force=True)


async def one_of_the_missed(client: PrefectClient, store: Store) -> None:
    """Of the runs that a deployment missed while nobody worked, keep the last: it makes up for all."""
    due = [run for run in await _runs(client, store, StateType.SCHEDULED, due=True) if run.auto_scheduled]
    last = {run.deployment_id: run for run in sorted(due, key=_start)}
    for run in due:
        if run.id != last[run.deployment_id].id:
            await client.set_flow_run_state(
                run.id, Cancelled(message="missed while no worker was there; a later one makes up for it"), force=True
            )


def _start(run: FlowRun) -> datetime:
    return run.expected_start_time or datetime.max.replace(tzinfo=UTC)


async def _runs(client: PrefectClient, store: Store, *states: StateType, due: bool = False) -> list[FlowRun]:
    """Return our runs in these states: not those of others on the same server, nor those of a terminal with another home."""
    chosen = FlowRunFilter(
        state=FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states))), tags=FlowRunFilterTags(all_=[OURS])
    )
    if due:
        latest = DateTime.now("UTC") - timedelta(seconds=_LOOK_EVERY_S)
        chosen.expected_start_time = FlowRunFilterExpectedStartTime(before_=latest)
    found = await _all(
        lambda offset: client.read_flow_runs(
            flow_run_filter=chosen, sort=FlowRunSort.ID_DESC, limit=_PAGE, offset=offset
        )
    )
    return [run for run in found if run.parameters.get("home", str(store.root)) == str(store.root)]


async def _all(page: Callable[[int], Awaitable[list[T]]]) -> list[T]:
    """Return what lies on all pages; `page(offset)` returns what follows the first so many."""
    found: list[T] = []
    while more := await page(len(found)):
        found += more
    return found


if __name__ == "__main__":
    main()
