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
from aug3d_core.scene_files.files import read_scene
from aug3d_core.store.store import Store
from flows.regenerate import regenerate
from flows.settings import home
from flows.shares import HELP, parameters_of
from tasks import artifacts
from tasks.progress import listening, reporter
from tasks.run_locks import run_lock


@flow(name=HELP, flow_run_name="help with {run}")
def help_with(run: Annotated[UUID, Field(description="The flow run of the scene.")]) -> State:
    """Make shards of what another machine makes of a scene: depth maps, renders. That machine takes them as they come."""
    _, given = parameters_of(run, {regenerate.name: regenerate})
    store = Store(home())
    with run_lock(store.root), store.using(), listening(artifacts.PrefectProgress()):
        entry = read_scene(store, given["scene"])
        visits = planned(store, entry.material(), given["settings"])
        now = next((visit for visit in visits if visit.record is None), None)
        if now is None or now.work is None or not now.step.stage.assist:
            return Completed(message="it is past the work that can be shared")
        helped = assist(store, now.work, reporter(now.step.name))
    return Completed(message=f"{now.step.name} of {given['scene']}{'' if helped else ' was there already'}")
