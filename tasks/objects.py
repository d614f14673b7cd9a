"""The one task of the project: make a stage's object. Every stage runs through it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prefect import task
from prefect.client.schemas.objects import State, TaskRun

from aug3d_core.errors import StageFailed
from aug3d_core.folds import Step
from aug3d_core.make import Source, key_of, make
from aug3d_core.stage import StageConfig
from aug3d_core.stages import stage_reading
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from tasks import artifacts, progress
from tasks.cache import ObjectCache


@dataclass(frozen=True)
class Made:
    """A step's record, and whether the store already had it."""

    step: Step
    record: Record
    cached: bool


async def _worth_a_retry(_task: Any, _run: TaskRun, state: State) -> bool:
    """Only an end from outside is worth a second try; a stage that says no would say it again."""
    failure = await state.aresult(raise_on_failure=False)
    return isinstance(failure, StageFailed) and failure.cause in ("crash", "killed")


@task(
    cache_policy=ObjectCache(),
    persist_result=True,
    result_serializer="json",
    cache_result_in_memory=False,
    retries=1,
    retry_condition_fn=_worth_a_retry,
    task_run_name="{step}",
)
def make_object(stage: str, config: StageConfig, sources: dict[str, Source], home: str, step: str) -> Record:
    """Compute an object in a process of its own; raises StageFailed. `step` is what the run calls it."""
    return make(Store(Path(home)), stage_reading(stage, sources), config, sources, progress.reporter(step))


def run_step(store: Store, step: Step, config: StageConfig, sources: dict[str, Source]) -> Made:
    """Make a step's object through Prefect, and leave its table and pictures in the Prefect UI."""
    cached = store.find(step.stage.name, key_of(step.stage, config, sources)) is not None
    progress.started(step.name)
    record = make_object(step.stage.name, config, sources, str(store.root), step.name)
    made = Made(step, record, cached)
    progress.finished(made)
    artifacts.publish(store, made)
    return made
