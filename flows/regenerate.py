"""Regenerate registered scenes: the flows that a schedule or a user of the Prefect UI starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, cast
from uuid import UUID

from prefect import flow
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterParentFlowRunId
from prefect.client.schemas.objects import FlowRun, State
from prefect.deployments import run_deployment
from prefect.exceptions import ObjectNotFound
from prefect.runtime import flow_run
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.estimate.room import check_room
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.run.errors import Aug3dError, UsageError, shown
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each, read_scene
from aug3d_core.store import layout
from aug3d_core.store.published import held_back, publish, published
from aug3d_core.store.scenes import (
    bring_versions,
    records_before,
    records_of,
    share_version,
    step_objects,
    version_metrics,
)
from aug3d_core.store.store import Store
from aug3d_core.store.traffic import Traffic
from flows.ends import AT_ONCE, ends_of
from flows.factory import beside_published, make_version, tell
from flows.photographs import material_of
from flows.plan import made_of_the_same
from flows.preflight import check_weights
from flows.settings import home
from flows.takeover import cancel_parts, unfinished
from tasks import artifacts
from tasks.progress import listening
from tasks.run_locks import run_lock
from tasks.tracking import publish_model

# Names of a flow run's last state
UNCHANGED, PUBLISHED, TRIED, NOT_PUBLISHED = "Unchanged", "Published", "Tried", "NotPublished"


@flow(name="regenerate", flow_run_name="{scene}")
def regenerate(
    scene: Annotated[str, Field(description="A registered scene; see aug3d scenes list.")],
    settings: Annotated[
        SceneConfig,
        Field(
            description="Settings of each stage. They come from the scene's file; a change here is for this run only."
        ),
    ],
) -> State:
    """Regenerate a scene where something changed, and publish it unless it is worse than the published version.

    Without a change no new version is written. A version that is worse, or that was made with other settings than those in
    the scene's file, is kept but not published.
    """
    store = Store(home())
    since = store.traffic()
    with run_lock(store.root), store.using():
        entry = read_scene(store, scene)
        check_weights(settings)
        material = material_of(store, scene, entry, settings)
        plan = list(planned(store, material, settings))
        if newest := made_of_the_same(store, scene, plan):
            metrics = version_metrics(newest)
            if not (newest / layout.TOLD).exists():
                tell(store, newest, metrics)
            artifacts.publish_changes(scene, None)
            if published(store, scene) == newest:
                return Completed(name=UNCHANGED, message=f"nothing changed since {newest.name}, which is published")
        else:
            metrics = _make(store, scene, entry, material, settings, plan, since)
            artifacts.publish_changes(scene, metrics)
        return _publish(store, scene, entry, settings, metrics)


def batch_name() -> str:
    """Return what a batch is called in the pages."""
    return ", ".join(flow_run.parameters["scenes"]) or "all scenes"


@flow(name="regenerate scenes", flow_run_name=batch_name, on_cancellation=[cancel_parts])
def batch(
    scenes: Annotated[list[str], Field(description="Registered scenes; leave empty for all.")] = [],
) -> State:
    """Regenerate several scenes, each in a run of its own that any worker takes; a failed scene does not stop the others."""
    store = Store(home())
    with run_lock(store.root):
        known = read_each(store)
        unknown = [scene for scene in scenes if scene not in known]
        if unknown:
            raise UsageError(
                f"scene {shown(unknown[0])} is not registered", f"registered scenes: {', '.join(known) or 'none yet'}"
            )
        ends = _regenerated({scene: known[scene] for scene in scenes or known})
    artifacts.publish_batch({scene: (state.name or "", state.message or "") for scene, state in ends.items()})
    bad = [scene for scene, state in ends.items() if not state.is_completed()]
    if bad:
        return Failed(message=f"{len(bad)} of {len(ends)} scenes were not published: {', '.join(bad)}")
    return Completed(message=f"{len(ends)} scenes are up to date")


def _regenerated(scenes: Mapping[str, SceneEntry | Aug3dError]) -> dict[str, State]:
    """Start a run for each scene, and return in which states they end. Runs that an earlier try left are waited for."""
    with get_client(sync_client=True) as client:
        left = _left(client)
        begun = {scene: left.get(scene) or _started(scene, entry) for scene, entry in scenes.items()}
        ends = ends_of(client, [run.id for run in begun.values() if isinstance(run, FlowRun)])
    return {scene: ends[run.id] if isinstance(run, FlowRun) else run for scene, run in begun.items()}


def _left(client: SyncPrefectClient) -> dict[str, FlowRun]:
    """Return the runs that this batch started before its process ended, and that have not ended, by scene."""
    mine = FlowRunFilterParentFlowRunId(any_=[UUID(str(flow_run.get_id()))])
    chosen, runs = FlowRunFilter(parent_flow_run_id=mine, state=unfinished()), []
    while more := client.read_flow_runs(flow_run_filter=chosen, limit=AT_ONCE, offset=len(runs)):
        runs += more
    return {str(run.parameters.get("scene")): run for run in runs}


def _started(scene: str, entry: SceneEntry | Aug3dError) -> FlowRun | State:
    """Start a scene's run on whichever worker takes it; return the state in which it ends at once if its file is wrong."""
    try:
        if isinstance(entry, Aug3dError):
            raise entry
        given = {"scene": scene, "settings": entry.config().model_dump(mode="json")}
        return cast(FlowRun, run_deployment(f"{regenerate.name}/{scene}", parameters=given, timeout=0))
    except Aug3dError as error:
        return Failed(message=f"{error.problem} -> {error.remedy}")
    except ObjectNotFound:
        return Failed(
            message="Prefect does not know it yet -> start it again: the worker registers new scenes in seconds"
        )


def _make(
    store: Store,
    scene: str,
    entry: SceneEntry,
    material: Material,
    settings: SceneConfig,
    plan: Sequence[Visit],
    since: Traffic,
) -> dict[str, Any]:
    before = records_before(store, scene)
    check_room(store, scene, material, settings, before, plan)
    with listening(artifacts.PrefectProgress()):
        return make_version(store, scene, material, entry.preset, settings, before, plan, since)


def _publish(store: Store, scene: str, entry: SceneEntry, settings: SceneConfig, metrics: Mapping[str, Any]) -> State:
    """Publish a version if the publish rule allows it; return the state that tells the result."""
    bring_versions(store, scene)  # another machine may have published one while this was made
    name = Path(
        metrics["paths"]["metrics"]
    ).parent.name  # made perhaps by another machine, or before the home was moved
    version, last = store.root / layout.SCENES / scene / name, published(store, scene)
    compared = beside_published(store, metrics, records_of(store, metrics))
    if compared:
        artifacts.publish_comparison(compared)
    against = held_back(metrics, version_metrics(last) if last else None, entry.publish.most_psnr_drop_db)
    if against:
        return Failed(name=NOT_PUBLISHED, message=f"{version.name} is not published: {against}")
    reached = f"{metrics['nvs']['test_psnr_mean']:.2f} dB on held-out photographs"
    if settings != entry.config():
        why = "its settings differ from those in the scene's file"
        return Completed(name=TRIED, message=f"{version.name} reaches {reached}; not published: {why}")
    share_version(store, version, step_objects(metrics).values())  # it may be older than the shared store
    publish(store, version)
    publish_model(store, scene, version.name)
    return Completed(name=PUBLISHED, message=f"{version.name} is published: {reached}")
