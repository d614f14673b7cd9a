"""The work pool of all flow runs, its queues, and the worker that takes runs from it: on one machine or on many."""

from __future__ import annotations

import asyncio
import math
import os
import secrets
import signal
import sys
import time
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

import psutil
from anyio.abc import TaskStatus
from httpx import HTTPError
from prefect.client.orchestration import PrefectClient, get_client
from prefect.client.schemas.actions import WorkPoolCreate
from prefect.client.schemas.filters import (
    FlowRunFilter,
    FlowRunFilterNextScheduledStartTime,
    FlowRunFilterState,
    FlowRunFilterStateType,
    FlowRunFilterWorkQueueName,
)
from prefect.client.schemas.objects import StateType
from prefect.exceptions import ObjectAlreadyExists, ObjectNotFound
from prefect.states import Failed
from prefect.utilities.processutils import command_to_string
from prefect.workers.process import ProcessJobConfiguration, ProcessWorker, ProcessWorkerResult

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import StoreError, shown
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.scene_files.files import REGISTRY
from aug3d_core.store.machine_name import machine_name
from aug3d_core.store.store import Store
from flows.serving import CPU, GPU
from flows.takeover import in_thread, lease_of, put_back

if TYPE_CHECKING:
    from prefect.client.schemas.objects import FlowRun

POOL = "aug3d"
WORKER = "prefect.worker.name"  # label of a run that Prefect gives it
ONLINE = "ONLINE"  # Prefect's word for a worker that was seen of late
HOME_QUEUE = "home"  # queue of what only the machine can do that has the scene files and the results of studies
PHOTOGRAPHS = "photographs"  # of scenes, read for runs on machines that lack them, which wait for it
BATCH = "batch"  # of runs that start others and wait for them: they may not hold what those need
REGISTRIES = (REGISTRY, COLLECTIONS)
RUNS_AT_ONCE = 2  # rendering and training take turns besides, whatever runs
_LOOK_EVERY_S = 5.0
_SEEN_EVERY_S = 30.0  # after a minute without a question the pages show a queue as not ready


class _Job(ProcessJobConfiguration):
    """How a run is started: with this Python, in this folder, whatever the pool says, and never to outlive its worker."""

    def prepare_for_flow_run(self, *args: Any, **kwargs: Any) -> None:
        self.command = command_to_string([sys.executable, "-m", "prefect.engine"])
        self.working_dir = Path.cwd()
        self.env = {**self.env, SUPERVISED: str(os.getpid())}
        super().prepare_for_flow_run(*args, **kwargs)


class PoolWorker(ProcessWorker):
    """Takes flow runs from queues of the pool, and executes each in a process of its own."""

    type = "aug3d"
    job_configuration = _Job

    def __init__(
        self,
        store: Store,
        queues: Iterable[str],
        limit: int,
        own: bool = False,
        before: Callable[[], None] = lambda: None,
    ) -> None:
        """Name the worker by machine, home and queues: the pages show it with each of its runs.

        own: whether it also serves the machine's own queue. before: called before each run, from a thread.
        """
        name, served = f"{machine(store)} ({', '.join(queues)})", [*queues, *([machine(store)] if own else [])]
        super().__init__(POOL, served, name, limit=limit, create_pool_if_not_found=False)
        self._store, self._before = store, before
        self.executed: set[UUID] = set()  # runs, now
        self._asked = -math.inf  # when Prefect was last asked for runs

    async def run(
        self,
        flow_run: FlowRun,
        configuration: ProcessJobConfiguration,
        task_status: TaskStatus[int] | None = None,
    ) -> ProcessWorkerResult:
        """Execute a run, and tell other machines all the while that somebody does; one that is killed goes on.

        One that was asked for with other parameters than its flow has fails at once, in words.
        """
        if wrong := await _wrong_parameters(self.client, flow_run):
            if task_status is not None:
                task_status.started(0)  # Prefect's worker waits for it, though no process is begun
            await self.client.set_flow_run_state(flow_run.id, Failed(message=wrong), force=True)
            return ProcessWorkerResult(identifier=str(flow_run.id), status_code=0)
        self.executed.add(flow_run.id)
        try:
            async with in_thread(_leased(self._store, flow_run)):
                await asyncio.to_thread(self._before)
                return await super().run(flow_run, configuration, task_status)
        finally:
            self.executed.discard(flow_run.id)

    async def _propose_crashed_state(
        self, flow_run: FlowRun, message: str, client: PrefectClient | None = None
    ) -> None:
        """Put a run back in line whose process was killed, or could not be begun since Prefect was away or too busy."""
        with _patient():  # or `stranded` finds it
            if not await put_back(self.client, flow_run.id):
                await super()._propose_crashed_state(flow_run, message, client)

    async def get_and_submit_flow_runs(self) -> list[FlowRun]:
        """Ask for runs; without an answer there are none yet, and those at work go on.

        An answer costs Prefect's server 53 ms of a processor, most of it to note in its database who asked, and to count
        the runs that are due 12 ms. So this is asked for if there are any, and else as often as the pages want it.
        """
        with _patient():
            if time.monotonic() - self._asked < _SEEN_EVERY_S and not await self._due():
                return []
            self._asked = time.monotonic()
            return await super().get_and_submit_flow_runs()
        return []

    async def _due(self) -> bool:
        """Say whether a run waits in a queue of this worker, and could be begun."""
        if self.limiter.available_tokens < 1:
            return False
        soon = datetime.now(UTC) + timedelta(seconds=self._prefetch_seconds)
        waiting = FlowRunFilter(
            state=FlowRunFilterState(type=FlowRunFilterStateType(any_=[StateType.SCHEDULED])),
            work_queue_name=FlowRunFilterWorkQueueName(any_=sorted(self._work_queues)),
            next_scheduled_start_time=FlowRunFilterNextScheduledStartTime(before_=soon),
        )
        return await self.client.count_flow_runs(flow_run_filter=waiting) > 0

    async def sync_with_backend(self) -> None:
        """Tell Prefect that this worker lives, if it can be told."""
        with _patient():
            await super().sync_with_backend()


def machine(store: Store) -> str:
    """Return how this machine is called, with its home."""
    return machine_name(store.root)


def machine_of(worker: str) -> str:
    """Return the machine of a worker, by the worker's name: Prefect keeps nothing else of a worker."""
    return worker.rpartition(" (")[0]


def queues_of(worker: str) -> tuple[str, ...]:
    """Return which queues a worker serves, by its name."""
    return tuple(worker.rpartition(" (")[2].rstrip(")").split(", "))


def _leased(store: Store, flow_run: FlowRun) -> AbstractContextManager[object]:
    if store.shared is None:
        return nullcontext()
    from aug3d_core.store.lease import lease

    def waiting(host: str) -> None:
        print(f"{flow_run.name}: waiting for {host}, which executes it", flush=True)

    return lease(store.shared.bucket, lease_of(flow_run.id), lambda: False, waiting, _begin_again)


async def _wrong_parameters(client: PrefectClient, flow_run: FlowRun) -> str:
    """Say which parameters a flow does not have, or lacks, since whoever asks Prefect can turn its own look off; "" if none."""
    if flow_run.deployment_id is None:
        return ""
    try:
        told = (await client.read_deployment(flow_run.deployment_id)).parameter_openapi_schema or {}
    except ObjectNotFound:  # it was removed meanwhile; the run says so itself
        return ""
    known = told.get("properties", {}).keys()
    unknown = [shown(name) for name in sorted(flow_run.parameters.keys() - known)]
    missing = sorted({*told.get("required", ())} - flow_run.parameters.keys())
    said = [f"there is no parameter {', '.join(unknown)}"] if unknown else []
    said += [f"a value is missing for {', '.join(missing)}"] if missing else []
    return f"{'; '.join(said)} -> ask again with values for: {', '.join(known) or 'none'}" if said else ""


async def make_pool(client: PrefectClient) -> None:
    """Make the pool and its queues where they are not there yet."""
    with suppress(ObjectAlreadyExists):
        template = PoolWorker.get_default_base_job_template()
        await client.create_work_pool(WorkPoolCreate(name=POOL, type=PoolWorker.type, base_job_template=template))
    for queue in (CPU, GPU, HOME_QUEUE, BATCH, PHOTOGRAPHS):
        await make_queue(client, queue)


async def make_queue(client: PrefectClient, queue: str) -> None:
    """Make a queue of the pool if it is not there yet."""
    with suppress(ObjectAlreadyExists):
        await client.create_work_queue(queue, work_pool_name=POOL)


def begin(home: Path) -> Store:
    """Become a worker of a home, and open its store."""
    if os.environ.get(SUPERVISED):
        die_with_parent()
    store = Store(home)
    store.check_writable()
    if store.shared is not None:
        from aug3d_core.store.lease import OWNER

        os.environ[OWNER] = secrets.token_hex(8)
    return store


async def again_and_again(look: Callable[[PrefectClient], Awaitable[None]]) -> None:
    """Do something every few seconds. While Prefect or the store is away it waits for them, and what runs goes on."""
    async with get_client() as client:
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            with _patient():
                await look(client)


@contextmanager
def _patient() -> Iterator[None]:
    """Take what cannot be reached now for what can be reached later."""
    try:
        yield
    except (HTTPError, StoreError) as error:
        print(f"{type(error).__name__}: {error}", flush=True)


async def work_until_ended(*work: Awaitable[None]) -> None:
    """Do all of it until told to end, or until one part ends or fails."""
    tasks = [asyncio.ensure_future(each) for each in work]
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _end)
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        if task.done():
            task.result()


def _end(*_: object) -> None:
    """Kill what runs: its runs stay where they are, and the next worker takes them over."""
    _kill_runs()
    os._exit(0)


def _begin_again() -> None:
    """Start anew when another machine has taken a run over, since this one could not be seen: two shall not execute it.

    Prefect is told nothing: the run is the other's.
    """
    print("another worker took a run over; what runs here is ended, and the worker starts again", flush=True)
    _kill_runs()
    os.execv(sys.executable, sys.orig_argv)


def _kill_runs() -> None:
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            child.kill()
