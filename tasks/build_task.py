"""The one task of the project: build a stage's object. Every stage of a run or a study runs through it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE
from prefect.client.schemas.objects import State, TaskRun
from prefect.states import Completed

from aug3d_core.factory.build import Built, Work, build
from aug3d_core.factory.cluster import with_cluster
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.run.errors import StageFailed
from aug3d_core.store.store import Store
from tasks import progress

CACHED = "Cached"  # name of the last state of a task run whose object was in the store


async def _worth_a_retry(_task: Any, _run: TaskRun, state: State) -> bool:
    """Only an end from outside is worth a second try; a stage that refuses its input would refuse it again."""
    failure = await state.aresult(raise_on_failure=False)
    return isinstance(failure, StageFailed) and failure.cause in ("crash", "killed")


# The store decides whether work has to be done, under the lock of the object: Prefect's own cache would be a second one.
@task(cache_policy=NO_CACHE, retries=1, retry_condition_fn=_worth_a_retry, task_run_name="{step}")
def build_object(work: Work, home: str, step: str) -> State[Built]:
    """Build an object in a process of its own, unless the store has it; raises StageFailed. step: its name in the run."""
    built = build(Store(Path(home)), work, progress.reporter(step))
    return Completed(name=CACHED if built.cached else None, data=built)


def through_prefect(store: Store, of: str = "") -> Make:
    """Return what a walk does with each step: run the task, and say what it is doing to those who listen.

    of: what the steps are of, where there are several walks in one flow. Raises UsageError where AUG3D_DASK cannot be used.
    """

    def make(visit: Visit) -> Built:
        assert visit.work
        name = f"{of} {visit.step.name}".strip()
        progress.started(name)
        state = build_object(visit.work, str(store.root), name, return_state=True)
        return state.result()

    return with_cluster(store, make)
