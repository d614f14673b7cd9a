"""What becomes of runs whose worker died: they are put back in line, and their cancelling is brought to an end.

On one machine the kernel tells whether a run has a process. Where machines share a store, a worker holds a lease on each
run that it executes; the others watch it, and by no clock but their own.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import AbstractContextManager, asynccontextmanager, suppress
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import UUID

import psutil
from prefect import Flow
from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.filters import (
    FlowRunFilter,
    FlowRunFilterExpectedStartTime,
    FlowRunFilterParentFlowRunId,
    FlowRunFilterState,
    FlowRunFilterStateType,
    FlowRunFilterTags,
)
from prefect.client.schemas.objects import FlowRun, State, StateType
from prefect.client.schemas.sorting import FlowRunSort
from prefect.states import AwaitingRetry, Cancelled, Cancelling, Crashed
from prefect.types import DateTime

from aug3d_core.store.store import Store
from flows.settings import OURS
from tasks.run_locks import has_process, was_here

if TYPE_CHECKING:  # with obstore, which a store of one machine does without
    from aug3d_core.store.lease import Watch

CANCELLED_WITHIN_S = 30.0
_DUE_S = 5.0
PAGE = 200  # the most that Prefect tells at a time
MOST_KILLS = 3  # of a run's process while its worker lives, as by a machine without memory
STARTED = StateType.RUNNING, StateType.PENDING
AT_WORK = *STARTED, StateType.CANCELLING
_KILLED = "its process was killed, or could not be begun; finished steps are not made again"
_ENDED = "its process ended before it did; finished steps are not made again"
_PART_ENDED = "its process has ended; whoever started it can start it again"

T = TypeVar("T")


def lease_of(flow_run_id: object) -> str:
    """Return the name of the lease that a worker holds while it executes a run."""
    return f"runs/{flow_run_id}"


async def take_over(client: PrefectClient, store: Store) -> None:
    """Put runs of this home that no process works on back in line; end those that were being cancelled, and parts of others.

    Where the store is shared, another machine may execute a run of a deployment: `take_over_from_others` sees to these.
    """
    for run in await our_runs(client, store, *AT_WORK):
        elsewhere = store.shared is not None and (
            run.deployment_id is not None or not (run.parameters.get("home") or was_here(store.root, str(run.id)))
        )
        if not elsewhere and not has_process(store.root, str(run.id)):
            await _end(client, run)


async def take_over_from_others(client: PrefectClient, watch: Watch, runs: Sequence[FlowRun]) -> None:
    """Look at the leases of the runs at work that workers execute; put back in line what nobody has worked on for long."""
    leased = {lease_of(run.id): run for run in runs if run.deployment_id}
    for name in await asyncio.to_thread(watch.dead, list(leased)):
        async with in_thread(watch.taking_over(name)) as ours:
            now = await client.read_flow_run(leased[name].id)
            if ours and now.state_id == leased[name].state_id:  # and it has not ended meanwhile
                await _end(client, now)


async def put_back(client: PrefectClient, flow_run_id: UUID) -> bool:
    """Put a run back in line that did not end by itself, unless that has happened too often; say whether it is in line."""
    run, before = await client.read_flow_run(flow_run_id), await client.read_flow_run_states(flow_run_id)
    if run.state_type == StateType.SCHEDULED:
        return True
    kills = 1 + sum(state.message == _KILLED for state in before)
    if run.state_type not in (*STARTED, StateType.CRASHED) or kills >= MOST_KILLS:
        return False
    await _end(client, run, _KILLED)
    return True


async def _end(client: PrefectClient, run: FlowRun, why: str = _ENDED) -> None:
    """Say that a run's process has ended, and those of its parts."""
    if run.state_type == StateType.CANCELLING:
        await cancel_started(client, run.id)
        state = Cancelled(message="its process has ended")
    elif run.deployment_id is None:  # a part of another run, or started in a terminal
        state = Crashed(message=_PART_ENDED)
    elif run.work_queue_id is None:
        state = Crashed(message="an earlier version of aug3d began it: start it again")
    else:
        state = AwaitingRetry(message=why)
        parts = FlowRunFilter(parent_flow_run_id=FlowRunFilterParentFlowRunId(any_=[run.id]), state=_in_state(*AT_WORK))
        for part in await client.read_flow_runs(flow_run_filter=parts, limit=PAGE):
            if part.deployment_id is None:
                await client.set_flow_run_state(part.id, Crashed(message=_PART_ENDED), force=True)
    await client.set_flow_run_state(run.id, state, force=True)


async def end_cancelled(client: PrefectClient, store: Store, runs: Sequence[FlowRun]) -> None:
    """End those being cancelled, of the runs at work, which Prefect's own worker should have ended.

    It no longer hears of cancelling once Prefect was away for some seconds.

    A run without a process here may have one on another machine, whose worker does the same.
    """
    for run in runs:
        if run.state_type != StateType.CANCELLING or not run.state:
            continue
        if run.state.timestamp > datetime.now(UTC) - timedelta(seconds=CANCELLED_WITHIN_S):
            continue
        killed = False
        for child in psutil.Process().children():
            with suppress(psutil.Error):
                if child.environ().get("PREFECT__FLOW_RUN_ID") == str(run.id):
                    child.kill()  # its stage dies with it
                    killed = True
        if killed or store.shared is None:
            await cancel_started(client, run.id)
            await client.set_flow_run_state(run.id, Cancelled(message="cancelled"), force=True)


async def cancel_started(client: PrefectClient, flow_run_id: UUID) -> None:
    """Cancel the runs of deployments that a run started."""
    parent = FlowRunFilterParentFlowRunId(any_=[flow_run_id])
    started = FlowRunFilter(parent_flow_run_id=parent, state=unfinished())
    for part in await on_all_pages(
        lambda offset, limit: client.read_flow_runs(flow_run_filter=started, limit=limit, offset=offset)
    ):
        if part.deployment_id:
            at_work = part.state_type in AT_WORK
            state = Cancelling() if at_work else Cancelled(message="what started it has ended, or was cancelled")
            await client.set_flow_run_state(part.id, state, force=True)


async def cancel_parts(flow: Flow[..., Any], flow_run: FlowRun, state: State) -> None:
    """Cancel the runs that a run started, as Prefect cancels the run itself."""
    await cancel_all_started(flow_run.id)


async def cancel_all_started(flow_run_id: UUID) -> None:
    """Cancel the runs that a run started."""
    async with get_client() as client:
        await cancel_started(client, flow_run_id)


def unfinished() -> FlowRunFilterState:
    """Return the filter of runs that have not ended."""
    return _in_state(StateType.SCHEDULED, *AT_WORK, StateType.PAUSED)


async def one_of_the_missed(client: PrefectClient, store: Store) -> None:
    """Of the runs that a deployment missed while nobody worked, keep the last: it makes up for all."""
    due = [run for run in await our_runs(client, store, StateType.SCHEDULED, due=True) if run.auto_scheduled]
    last = {run.deployment_id: run for run in sorted(due, key=_start)}
    for run in due:
        if run.id != last[run.deployment_id].id:
            await client.set_flow_run_state(
                run.id, Cancelled(message="missed while no worker was there; a later one makes up for it"), force=True
            )


def _start(run: FlowRun) -> datetime:
    return run.expected_start_time or datetime.max.replace(tzinfo=UTC)


async def our_runs(client: PrefectClient, store: Store, *states: StateType, due: bool = False) -> list[FlowRun]:
    """Return our runs in these states: not those of others on the same server, nor those of a terminal with another home."""
    chosen = FlowRunFilter(state=_in_state(*states), tags=FlowRunFilterTags(all_=[OURS]))
    if due:
        latest = DateTime.now("UTC") - timedelta(seconds=_DUE_S)
        chosen.expected_start_time = FlowRunFilterExpectedStartTime(before_=latest)
    found = await on_all_pages(
        lambda offset, limit: client.read_flow_runs(
            flow_run_filter=chosen, sort=FlowRunSort.ID_DESC, limit=limit, offset=offset
        )
    )
    return [run for run in found if run.parameters.get("home", str(store.root)) == str(store.root)]


def _in_state(*states: StateType) -> FlowRunFilterState:
    return FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states)))


async def on_all_pages(page: Callable[[int, int], Awaitable[Sequence[T]]]) -> list[T]:
    """Return what lies on all pages; `page(offset, limit)` returns at most so many of what follows."""
    found: list[T] = []
    while True:
        more = await page(len(found), PAGE)
        found += more
        if len(more) < PAGE:
            return found


@asynccontextmanager
async def in_thread(manager: AbstractContextManager[T]) -> AsyncIterator[T]:
    """Enter and leave a context that waits, without keeping others from working meanwhile."""
    value = await asyncio.to_thread(manager.__enter__)
    try:
        yield value
    except BaseException as error:
        if not await asyncio.to_thread(manager.__exit__, type(error), error, error.__traceback__):
            raise
    else:
        await asyncio.to_thread(manager.__exit__, None, None, None)
