"""Regenerate registered scenes: the flows that a schedule or a user of the Prefect UI starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from prefect import flow, tags
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.disk_estimate import check_room
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.run.errors import Aug3dError, UsageError, shown
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each, read_scene
from aug3d_core.store.published import held_back, publish, published
from aug3d_core.store.scenes import bring_versions, records_before, records_of, version_metrics
from aug3d_core.store.store import Store
from aug3d_core.store.traffic import Traffic
from flows.factory import beside_published, make_version
from flows.plan import made_of_the_same
from flows.settings import OURS, home
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
        plan = list(planned(store, entry.material(), settings))
        if newest := made_of_the_same(store, scene, plan):
            metrics = version_metrics(newest)
            artifacts.publish_changes(scene, None)
            if published(store, scene) == newest:
                return Completed(name=UNCHANGED, message=f"nothing changed since {newest.name}, which is published")
        else:
            metrics = _make(store, scene, entry, settings, plan, since)
            artifacts.publish_changes(scene, metrics)
        return _publish(store, scene, entry, settings, metrics)


@flow(name="regenerate scenes", flow_run_name="scenes {scenes}")
def batch(
    scenes: Annotated[
        list[str], Field(description="Registered scenes, one after the other; leave empty for all.")
    ] = [],
) -> State:
    """Regenerate several scenes, each where something changed; a failed scene does not stop the others."""
    store = Store(home())
    with run_lock(store.root):
        known = read_each(store)
        unknown = [scene for scene in scenes if scene not in known]
        if unknown:
            raise UsageError(
                f"scene {shown(unknown[0])} is not registered", f"registered scenes: {', '.join(known) or 'none yet'}"
            )
        with tags(OURS):  # subflow runs do not inherit tags
            ends = {scene: _regenerated(scene, known[scene]) for scene in scenes or known}
    artifacts.publish_batch({scene: (state.name or "", state.message or "") for scene, state in ends.items()})
    bad = [scene for scene, state in ends.items() if not state.is_completed()]
    if bad:
        return Failed(message=f"{len(bad)} of {len(ends)} scenes were not published: {', '.join(bad)}")
    return Completed(message=f"{len(ends)} scenes are up to date")


def _regenerated(scene: str, entry: SceneEntry | Aug3dError) -> State:
    try:
        if isinstance(entry, Aug3dError):
            raise entry
        return regenerate(scene, entry.config(), return_state=True)
    except Aug3dError as error:  # its own file is wrong
        return Failed(message=f"{error.problem} -> {error.remedy}")


def _make(
    store: Store, scene: str, entry: SceneEntry, settings: SceneConfig, plan: Sequence[Visit], since: Traffic
) -> dict[str, Any]:
    material, before = entry.material(), records_before(store, scene)
    check_room(store, scene, material, settings, before, [(visit.step, visit.record) for visit in plan])
    with listening(artifacts.PrefectProgress()):
        return make_version(store, scene, material, entry.preset, settings, before, plan, since)


def _publish(store: Store, scene: str, entry: SceneEntry, settings: SceneConfig, metrics: Mapping[str, Any]) -> State:
    """Publish a version if the publish rule allows it; return the state that tells the result."""
    bring_versions(store, scene)  # another machine may have published one while this was made
    version, last = Path(metrics["paths"]["metrics"]).parent, published(store, scene)
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
    publish(store, scene, version)
    publish_model(store, scene, version.name)
    return Completed(name=PUBLISHED, message=f"{version.name} is published: {reached}")
