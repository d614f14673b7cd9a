"""The work pool of all flow runs, its queues, and the worker that takes runs from it: on one machine or on many."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from prefect.client.orchestration import PrefectClient
from prefect.client.schemas.actions import WorkPoolCreate
from prefect.exceptions import ObjectAlreadyExists
from prefect.utilities.processutils import command_to_string
from prefect.workers.process import ProcessJobConfiguration, ProcessWorker

from aug3d_core.run.linux_process import SUPERVISED

POOL = "aug3d"
CPU, GPU = "cpu", "gpu"  # queues of what any machine can do; a scene with the tag gpu goes to that one
HOME = "home"  # of what only the machine can do that has the scene files and the results of studies
BATCH = "batch"  # of runs that start others and wait for them: they may not hold what those need
QUEUES = (CPU, GPU, HOME, BATCH)


class _Job(ProcessJobConfiguration):
    """How a run is started: with this Python, in this folder, whatever the pool says, and never to outlive its worker."""

    def prepare_for_flow_run(self, *args: Any, **kwargs: Any) -> None:
        self.command = command_to_string([sys.executable, "-m", "prefect.engine"])
        self.working_dir = Path.cwd()
        self.env = {**self.env, SUPERVISED: "1"}
        super().prepare_for_flow_run(*args, **kwargs)


class PoolWorker(ProcessWorker):
    """Takes flow runs from queues of the pool, and executes each in a process of its own."""

    type = "aug3d"
    job_configuration = _Job

    def __init__(self, home: Path, queues: Iterable[str], limit: int) -> None:
        """Name the worker by machine, home and queues: the pages show it with each of its runs."""
        name = f"{socket.gethostname()} {home.name} ({', '.join(queues)})"
        super().__init__(POOL, list(queues), name, limit=limit, create_pool_if_not_found=False)


async def make_pool(client: PrefectClient) -> None:
    """Make the pool and its queues where they are not there yet."""
    with suppress(ObjectAlreadyExists):
        template = ProcessWorker.get_default_base_job_template()
        await client.create_work_pool(WorkPoolCreate(name=POOL, type=PoolWorker.type, base_job_template=template))
    for queue in QUEUES:
        with suppress(ObjectAlreadyExists):
            await client.create_work_queue(queue, work_pool_name=POOL)
