"""Other machines take part: they make cells of a study, or shards of a stage that takes long, each in a flow run of its own.

Whoever starts these runs ends them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from threading import Event
from typing import Any
from uuid import UUID

from httpx import HTTPError
from prefect import Flow
from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.objects import StateType
from prefect.deployments import run_deployment
from prefect.exceptions import ObjectNotFound
from prefect.runtime import deployment, flow_run
from prefect.utilities.callables import get_call_parameters

from aug3d_core.factory.build import Built
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.run.beside import beside
from aug3d_core.run.errors import UsageError
from aug3d_core.store.store import Store
from flows.pool import BATCH, ONLINE, POOL, WORKER, machine, machine_of, queues_of
from flows.serving import CPU, GPU
from flows.takeover import AT_WORK, cancel_all_started, our_runs

SHARE, HELP = "share of a study", "help with a scene"  # names of the flows
DEPLOYED = "for a worker"  # and of their deployments
ASK_EVERY_S = 30.0  # whoever is idle then is worth the seconds that it takes to begin


@contextmanager
def shared_out(store: Store) -> Iterator[None]:
    """Let each other machine that takes runs make cells of the present study too, while the block runs."""
    if store.shared is None or not deployment.id:
        yield
        return
    study = str(flow_run.id)
    try:
        for other in asyncio.run(_others(store)):
            _begin(SHARE, other, {"study": study}, f"{study} {other}")
        yield
    finally:
        asyncio.run(cancel_all_started(UUID(study)))  # all cells are there, or nobody reads them


def with_help(store: Store, make: Make) -> Make:
    """Return what makes a step of the present run and, while that takes long, has idle machines make shards of it."""

    def made(visit: Visit) -> Built | None:
        if not visit.step.stage.assist or visit.work is None:
            return make(visit)
        with _asking_the_idle(store, visit.step.name, visit.work.key):
            return make(visit)

    return made


@contextmanager
def _asking_the_idle(store: Store, step: str, key: str) -> Iterator[None]:
    """Ask machines that have nothing to do for help with a step, again and again while the block runs."""
    run, asked = str(flow_run.id), set[str]()

    def ask(over: Event) -> None:
        while not over.wait(ASK_EVERY_S):
            with suppress(HTTPError):  # Prefect is away: the work goes on without help
                for other in asyncio.run(_idle(store)):
                    _begin(HELP, other, {"run": run, "step": step, "key": key}, f"{run} {step} {other}")
                    asked.add(other)

    try:
        with beside(ask):
            yield
    finally:
        if asked:
            asyncio.run(cancel_all_started(UUID(run)))  # all shards are there


def _begin(flow: str, machine: str, parameters: dict[str, Any], once: str) -> None:
    """Start a flow run on a machine; one that was started under the same words is not started again."""
    run_deployment(
        f"{flow}/{DEPLOYED}", parameters=parameters, timeout=0, work_queue_name=machine, idempotency_key=once
    )


def parameters_of(run: UUID, flows: Mapping[str, Flow[..., Any]]) -> tuple[str, dict[str, Any]]:
    """Return the flow's name and the parameters of a run that is to be taken part in; raises UsageError if it is none."""
    with get_client(sync_client=True) as client:
        try:
            there = client.read_flow_run(run)
            name = client.read_flow(there.flow_id).name
        except ObjectNotFound:
            name = ""
    if name not in flows:
        raise UsageError(f"there is no run {run} to take part in", "studies and scenes start such runs themselves")
    return name, get_call_parameters(flows[name].fn, (), flows[name].validate_parameters(there.parameters))


async def _others(store: Store) -> list[str]:
    """Return which other machines take runs that any can do."""
    async with get_client() as client:
        return await _takers(client, store)


async def _idle(store: Store) -> list[str]:
    """Return which other machines take runs, and have none: nobody, while a run that any can do waits."""
    async with get_client() as client:
        due = await our_runs(client, store, StateType.SCHEDULED, due=True)
        if any(run.work_queue_name in (CPU, GPU) for run in due):
            return []
        working = await our_runs(client, store, *AT_WORK)
        busy = {machine_of(str(run.labels.get(WORKER))) for run in working if run.work_queue_name != BATCH}
        return [other for other in await _takers(client, store) if other not in busy]


async def _takers(client: PrefectClient, store: Store) -> list[str]:
    online = (one.name for one in await client.read_workers_for_work_pool(POOL) if one.status == ONLINE)
    takers = {machine_of(name) for name in online if CPU in queues_of(name)}
    return sorted(takers - {machine(store)})
