"""What can be started in the Prefect UI: each scene of the registry, all of them, each collection, and each study."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Any

from prefect import Flow
from prefect.client.schemas.objects import ConcurrencyLimitConfig, ConcurrencyLimitStrategy, State
from prefect.deployments.runner import RunnerDeployment
from prefect.schedules import Cron, Interval, Schedule
from prefect.types.entrypoint import EntrypointType
from prefect.utilities.annotations import freeze
from prefect.utilities.callables import ParameterSchema

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.schedule import Schedule as When
from flows.collection_run import train_collection
from flows.help_run import help_with
from flows.photographs import read_photographs
from flows.pool import BATCH, HOME_QUEUE, PHOTOGRAPHS, POOL
from flows.regenerate import batch, regenerate
from flows.serving import CPU, GPU
from flows.settings import COLLECTION, OURS, SCENE
from flows.shares import DEPLOYED
from flows.study_run import share, stability, study_scene, tradeoff

_ONE_AT_A_TIME = ConcurrencyLimitConfig(limit=1, collision_strategy=ConcurrencyLimitStrategy.ENQUEUE)
_STUDIES: tuple[tuple[Flow[..., State], str, dict[str, Any], str], ...] = (  # flow, name, what it is given, description
    (
        study_scene,
        "grouping",
        {"study": freeze("grouping")},
        "Ways of grouping x K; then 3, 6 and 9 input views: the paper's first table.",
    ),
    (
        study_scene,
        "augmentation",
        {"study": freeze("augmentation")},
        "Photographs, virtual views and both x K, and how many virtual views: the paper's second table.",
    ),
    (
        tradeoff,
        "tradeoff",
        {},
        "Time against accuracy: every setting of every stage, the whole factory, and auto. A night.",
    ),
    (
        stability,
        "stability",
        {},
        "Worse and worse photographs, poses, meshes and settings: where methods break, and who notices. A night.",
    ),
)
_PARTS: tuple[tuple[Flow[..., State], str, str], ...] = (  # flow, queue, description
    (share, CPU, "Started by studies, not by people: makes cells of a study of another machine."),
    (
        help_with,
        CPU,
        "Started by runs of scenes, not by people: makes shards of a stage that takes another machine long.",
    ),
    (
        read_photographs,
        PHOTOGRAPHS,
        "Started by runs of scenes, not by people: reads photographs that their machine lacks.",
    ),
)


class _Closed(ParameterSchema):
    """The parameters of a flow and no others: Prefect would take them, and the run would crash before it begins."""

    additionalProperties: bool


async def of_scene(scene: str, entry: SceneEntry) -> RunnerDeployment:
    """Return the deployment of a scene, with its settings as the form's values; raises UsageError if they are wrong."""
    facts = [
        entry.description,
        f"Photographs: {entry.photos or 'the built-in town'}",
        f"Licence: {entry.licence}" if entry.licence else "",
        entry.schedule.words() if entry.schedule else "No schedule",
    ]
    return await _deployment(
        regenerate,
        name=scene,
        queue=GPU if GPU in entry.tags else CPU,
        parameters={"scene": freeze(scene), "settings": entry.config().model_dump(mode="json")},
        schedules=[_schedule(entry.schedule)] if entry.schedule else [],
        tags=[SCENE, entry.preset, *entry.tags],
        description="\n\n".join(fact for fact in facts if fact),
    )


async def of_collection(name: str, entry: CollectionEntry) -> RunnerDeployment:
    """Return the deployment of a collection."""
    parts = [
        entry.description,
        f"Trained on: {', '.join(entry.train) or 'no scene'}; {entry.towns} made-up towns",
        f"Held out: {', '.join(entry.hold_out) or 'none'}",
        entry.schedule.words() if entry.schedule else "No schedule",
    ]
    return await _deployment(
        train_collection,
        name=name,
        queue=CPU,
        parameters={"collection": freeze(name)},
        schedules=[_schedule(entry.schedule)] if entry.schedule else [],
        tags=[COLLECTION, entry.preset],
        description="\n\n".join(part for part in parts if part),
    )


async def of_everything() -> AsyncIterator[RunnerDeployment]:
    """Yield the deployments that are there whatever the registry holds."""
    yield await _deployment(
        batch,
        name="all scenes",
        queue=BATCH,
        description="Makes scenes again, each as far as something changed, and as many at once as workers take.",
    )
    for flow, queue, description in _PARTS:
        yield await _deployment(
            flow, name=DEPLOYED, queue=queue, description=description, at_once=None, tags=["part of another run"]
        )
    for study, name, given, description in _STUDIES:
        yield await _deployment(
            study,
            name=name,
            queue=HOME_QUEUE,
            parameters=given,
            tags=["study"],
            description=description,
        )


async def _deployment(
    flow: Flow[..., State],
    name: str,
    queue: str,
    description: str,
    at_once: ConcurrencyLimitConfig | None = _ONE_AT_A_TIME,
    parameters: Mapping[str, Any] = {},
    tags: Sequence[str] = (),
    schedules: Sequence[Schedule] = (),
) -> RunnerDeployment:
    made = await flow.ato_deployment(
        name=name,
        parameters=dict(parameters),
        schedules=list(schedules),
        tags=[OURS, *tags],
        description=description,
        concurrency_limit=at_once,
        entrypoint_type=EntrypointType.MODULE_PATH,
        work_pool_name=POOL,
        work_queue_name=queue,
    )
    fields = made._parameter_openapi_schema.model_dump(exclude_unset=True)
    made._parameter_openapi_schema = _Closed(**fields, additionalProperties=False)  # Prefect sends only what is set
    return made


def _schedule(schedule: When) -> Schedule:
    interval = schedule.interval()
    if interval is None:
        return Cron(schedule.cron or "", timezone=schedule.timezone, active=not schedule.paused)
    return Interval(interval, anchor_date=schedule.anchor(), timezone="UTC", active=not schedule.paused)
