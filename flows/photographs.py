"""Photographs and poses that only one machine has: it reads them for the others, which get what its first stages made."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, cast

from prefect import flow
from prefect.client.orchestration import get_client
from prefect.client.schemas.objects import FlowRun, State
from prefect.deployments import run_deployment
from prefect.states import Completed
from pydantic import Field

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.material import Elsewhere, Material
from aug3d_core.factory.stages import FROM_MODEL, PHOTOS, POSES
from aug3d_core.factory.walk import walk
from aug3d_core.photos.discover import find_photos
from aug3d_core.run.errors import InputError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_scene, scene_file
from aug3d_core.scene_files.mirror import tell_photographs, told_photographs, was_brought
from aug3d_core.store.store import Store
from flows.ends import ends_of
from flows.settings import home
from flows.shares import DEPLOYED
from tasks import artifacts, progress
from tasks.build_task import through_prefect
from tasks.run_locks import run_lock

if TYPE_CHECKING:  # with obstore, which a store of one machine does without
    from aug3d_core.store.bucket import Bucket

_READ = "photographs of a scene"


@flow(name=_READ, flow_run_name="photographs of {scene}")
def read_photographs(
    scene: Annotated[str, Field(description="A registered scene.")],
    settings: Annotated[
        SceneConfig, Field(description="Settings of each stage; only those of `photos` and `poses` count.")
    ],
) -> State:
    """Read a scene's photographs and poses, on the machine that has the scene files, for a run on one that lacks them."""
    store = Store(home())
    with run_lock(store.root), store.using(), progress.listening(artifacts.PrefectProgress()):
        material = read_scene(store, scene).material()
        assert material.photos
        stages = material.stages()
        first = [stage for stage in stages if {*stage.inputs} & {"folder", "given"}]
        made = {
            visit.step.name: visit
            for visit in walk(store, first, settings, material, through_prefect(store), folds=False)
        }
        photos, poses = made[PHOTOS.name], made.get(POSES.name)
        assert photos.work and photos.record
        read = Elsewhere(
            photos=photos.work.input_digests["folder"],
            photo_count=len(find_photos(material.photos).names),
            poses=poses.work.input_digests["given"] if poses and poses.work else None,
            has_points=stages == FROM_MODEL,
        )
        if store.shared is not None:
            tell_photographs(store.shared.bucket, scene, read)
    return Completed(message=f"{photos.record.metrics['photos']} photographs of {scene}")


def material_of(store: Store, scene: str, entry: SceneEntry, settings: SceneConfig | None = None) -> Material:
    """Return what a scene is made of. What is not here is read now by the machine that has the scene files.

    settings: None for those of the entry. Raises InputError that names what is missing, and on which machine.
    """
    try:
        return entry.material()
    except InputError:
        if (bucket := _bucket_of_others(store, scene, entry)) is None:
            raise
    parameters = {"scene": scene, "settings": (settings or entry.config()).model_dump(mode="json")}
    begun = cast(FlowRun, run_deployment(f"{_READ}/{DEPLOYED}", parameters=parameters, timeout=0))
    with get_client(sync_client=True) as client:
        end = ends_of(client, [begun.id])[begun.id]
    if not end.is_completed():
        raise InputError(
            f"photographs or poses of {scene} are not on this machine, and could not be read where its file is: {end.message}",
            "see the run `photographs of a scene` in Prefect's pages",
        )
    return entry.material(told_photographs(bucket, scene))


def known_material(store: Store, scene: str, entry: SceneEntry) -> Material:
    """Return what a scene is made of, for whoever takes part in a run that asked for its photographs before."""
    try:
        return entry.material()
    except InputError:
        bucket = _bucket_of_others(store, scene, entry)
        if bucket is None or (read := told_photographs(bucket, scene)) is None:
            raise
    return entry.material(read)


def _bucket_of_others(store: Store, scene: str, entry: SceneEntry) -> Bucket | None:
    """Return where another machine tells of a scene's photographs; None for a scene of this machine, or without any."""
    if store.shared is None or entry.photos is None or not was_brought(scene_file(store, scene)):
        return None
    return store.shared.bucket
