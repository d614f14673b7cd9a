"""A worker with nothing else to do helps with a scene of another: a flow run that the scene's run starts and ends."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from prefect import flow
from prefect.client.schemas.objects import State
from prefect.states import Completed
from pydantic import Field

from aug3d_core.factory.build import assist
from aug3d_core.factory.walk import planned
from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.files import read_scene
from aug3d_core.store.store import Store
from flows.photographs import known_material
from flows.regenerate import regenerate
from flows.settings import home
from flows.shares import HELP, parameters_of
from tasks import artifacts
from tasks.progress import listening, reporter
from tasks.run_locks import run_lock


@flow(name=HELP, flow_run_name="help with {step}")
def help_with(
    run: Annotated[UUID, Field(description="The flow run of the scene.")],
    step: Annotated[str, Field(description="The step that it is at.")],
    key: Annotated[str, Field(description="The key of the object that it makes.")],
) -> State:
    """Make shards of what another machine makes of a scene: depth maps, renders. That machine takes them as they come."""
    _, given = parameters_of(run, {regenerate.name: regenerate})
    store, scene = Store(home()), given["scene"]
    with run_lock(store.root), store.using(), listening(artifacts.PrefectProgress()):
        visits = planned(store, known_material(store, scene, read_scene(store, scene)), given["settings"])
        work = next((visit.work for visit in visits if visit.step.name == step and visit.step.stage.assist), None)
        if work is None or work.key != key:
            raise UsageError(
                f"{step} of {scene} would be another one here: {work.key if work else 'nothing'}, not {key}",
                "install the same versions of aug3d and its engines on all machines",
            )
        helped = assist(store, work, reporter(step))
    return Completed(message=f"{step} of {scene}{'' if helped else ' is there already'}")
