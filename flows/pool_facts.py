"""What `aug3d status` tells of the pool: machines, what each does, what waits and why, as JSON holds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.filters import (
    ArtifactFilter,
    ArtifactFilterFlowRunId,
    ArtifactFilterType,
    FlowRunFilter,
    FlowRunFilterId,
    TaskRunFilter,
    TaskRunFilterState,
    TaskRunFilterStateType,
    TaskRunFilterSubFlowRuns,
)
from prefect.client.schemas.objects import FlowRun, StateType
from prefect.exceptions import ObjectNotFound

from aug3d_core.run.errors import Aug3dError
from aug3d_core.store.scenes import newest_whole
from aug3d_core.store.store import Store
from flows.pool import ONLINE, POOL, WORKER, machine_of, queues_of
from flows.settings import SCENE
from flows.takeover import AT_WORK, PAGE, on_all_pages, our_runs

if TYPE_CHECKING:
    from prefect.client.schemas.objects import Worker

_ONE_AT_A_TIME = "AwaitingConcurrencySlot"  # Prefect's name of the state


async def pool_facts(store: Store) -> dict[str, Any]:
    """Return `machines`, the runs `at_work` on them and those that are `waiting`; scenes are those of the store.

    Runs that are due later only are no part of it: `aug3d scenes list` has the schedules.
    """
    async with get_client() as client:
        try:
            workers = await on_all_pages(
                lambda offset, limit: client.read_workers_for_work_pool(POOL, offset=offset, limit=limit)
            )
        except ObjectNotFound:  # nothing of aug3d has ever worked there
            workers = []
        working = [run for run in await our_runs(client, store, *AT_WORK) if run.deployment_id]
        waiting = [run for run in await our_runs(client, store, StateType.SCHEDULED, due=True) if run.deployment_id]
        at_work = [await _at_work(client, store, run) for run in sorted(working, key=_since)]
    machines = [_machine(worker, at_work) for worker in sorted(workers, key=lambda worker: worker.name)]
    return {
        "machines": machines,
        "at_work": at_work,
        "waiting": [_waiting(run, machines) for run in sorted(waiting, key=_since)],
    }


def _machine(worker: Worker, at_work: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    seen = worker.last_heartbeat_time
    return {
        "machine": worker.name,
        "queues": list(queues_of(worker.name)),
        "online": worker.status == ONLINE,
        "seen_s_ago": round((datetime.now(UTC) - seen).total_seconds()) if seen else None,
        "runs": [run["run"] for run in at_work if run["machine"] == worker.name],
    }


async def _at_work(client: PrefectClient, store: Store, run: FlowRun) -> dict[str, Any]:
    steps = await _steps(client, run.id, StateType.RUNNING)
    percent, doing = await _progress(client, run.id, steps)
    scene = _scene(run)
    return {
        "run": run.name,
        "scene": scene,
        "machine": run.labels.get(WORKER),
        "state": run.state_name,
        "since": _since(run).isoformat(timespec="seconds"),
        "steps": steps,
        "percent": percent,
        "doing": doing,
        "left_s": None
        if scene is None
        else _left_s(store, scene, await _steps(client, run.id, StateType.COMPLETED), steps, percent),
    }


async def _steps(client: PrefectClient, run: UUID, state: StateType) -> list[str]:
    """Return the steps of a run that are in a state; runs that it started are none."""
    chosen = TaskRunFilter(
        state=TaskRunFilterState(type=TaskRunFilterStateType(any_=[state])),
        subflow_runs=TaskRunFilterSubFlowRuns(exists_=False),
    )
    of_run = FlowRunFilter(id=FlowRunFilterId(any_=[run]))
    found = await client.read_task_runs(flow_run_filter=of_run, task_run_filter=chosen, limit=PAGE)
    return [task.name for task in found]


async def _progress(client: PrefectClient, run: UUID, steps: Sequence[str]) -> tuple[float | None, str]:
    """Return how far the last step is that tells it, if that is at work, and what it says that it does."""
    told = await client.read_artifacts(
        artifact_filter=ArtifactFilter(
            type=ArtifactFilterType(any_=["progress"]), flow_run_id=ArtifactFilterFlowRunId(any_=[run])
        ),
        limit=PAGE,
    )
    of_steps = [one for one in told if one.updated and (one.description or "").partition(":")[0] in steps]
    last = max(of_steps, key=lambda one: one.updated or datetime.min.replace(tzinfo=UTC), default=None)
    return (round(float(str(last.data)), 1), str(last.description).partition(": ")[2]) if last else (None, "")


def _left_s(
    store: Store, scene: str, done: Sequence[str], working: Sequence[str], percent: float | None
) -> float | None:
    """Return how long the steps that are left took in the scene's last whole version [s]; None if there is none.

    That is the most: what did not change is not made again.
    """
    try:
        stages = newest_whole(store, scene)["stages"]
    except Aug3dError:
        return None
    left = {name: figures["seconds"] for name, figures in stages.items() if name not in done}
    if percent is not None:
        left |= {name: left[name] * (1 - percent / 100) for name in working if name in left}
    return round(sum(left.values()), 1)


def _waiting(run: FlowRun, machines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "run": run.name,
        "queue": run.work_queue_name,
        "since": _since(run).isoformat(timespec="seconds"),
        "why": _why(run, machines),
    }


def _why(run: FlowRun, machines: Sequence[Mapping[str, Any]]) -> str:
    """Say why nobody executes a run that is due."""
    serving = ((one, (*one["queues"], machine_of(one["machine"]))) for one in machines if one["online"])
    takers = [one for one, queues in serving if run.work_queue_name in queues]
    if run.state_name == _ONE_AT_A_TIME:
        return "an earlier run of the same is at work"
    if not takers:
        return f"no machine takes runs of the queue {run.work_queue_name}"
    if run.state and run.state.message:
        return run.state.message
    busy = [one for one in takers if one["runs"]]
    return (
        f"{len(busy)} of {len(takers)} machines that take it are at work" if busy else "a machine is about to take it"
    )


def _scene(run: FlowRun) -> str | None:
    return str(run.parameters["scene"]) if SCENE in run.tags else None


def _since(run: FlowRun) -> datetime:
    return run.start_time or run.expected_start_time or datetime.max.replace(tzinfo=UTC)
