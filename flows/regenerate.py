"""Scenes of the registry, made again as far as something changed: what a schedule, or a person in the Prefect UI, starts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from prefect import flow, tags
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.errors import Aug3dError, UsageError
from aug3d_core.registry.entry import SceneEntry
from aug3d_core.registry.files import read_each, read_scene
from aug3d_core.scene_config import SceneConfig
from aug3d_core.store.published import held_back, publish, published
from aug3d_core.store.room import check_room
from aug3d_core.store.scenes import records_before, records_of, version_metrics, versions
from aug3d_core.store.store import Store
from flows.factory import beside_published, make_version
from flows.plan import planned
from flows.settings import OURS, home
from tasks import artifacts
from tasks.alive import alive
from tasks.progress import listening
from tasks.tracking import publish_model

# Names of a flow run's last state
UNCHANGED, PUBLISHED, TRIED, NOT_PUBLISHED = "Unchanged", "Published", "Tried", "NotPublished"


@flow(name="regenerate", flow_run_name="{scene}")
def regenerate(
    scene: Annotated[str, Field(description="A scene of the registry: aug3d scenes list.")],
    settings: Annotated[
        SceneConfig, Field(description="Stage by stage; as the scene's file has them, unless changed here for one run.")
    ],
) -> State:
    """Make a scene again as far as something changed, and publish it unless it is worse than what is published.

    Without any change nothing is made, not even a version. A version that is worse, or that was made with other settings than
    the scene's file has, stays on the disk, unpublished.
    """
    store = Store(home())
    with alive(store.root), store.using():
        entry, newest = read_scene(store, scene), versions(store, scene)[-1:]
        if newest and _made_of(store, newest[0]) == _wanted(store, entry, settings):
            metrics = version_metrics(newest[0])
            artifacts.publish_changes(scene, None)
            if published(store, scene) == newest[0]:
                return Completed(name=UNCHANGED, message=f"{newest[0].name} is published and nothing changed since")
        else:
            metrics = _make(store, scene, entry, settings)
            artifacts.publish_changes(scene, metrics)
        return _publish(store, scene, entry, settings, metrics)


@flow(name="regenerate scenes", flow_run_name="scenes {scenes}")
def batch(
    scenes: Annotated[
        list[str], Field(description="Scenes of the registry, made one after the other; none means all.")
    ] = [],
) -> State:
    """Make several scenes again, each as far as something changed; a scene that fails does not stop the others."""
    store = Store(home())
    with alive(store.root):
        known = read_each(store)
        unknown = [scene for scene in scenes if scene not in known]
        if unknown:
            raise UsageError(
                f"the registry has no scene {unknown[0]!r}", f"scenes there: {', '.join(known) or 'none yet'}"
            )
        with tags(OURS):  # a run's tags do not go on to the runs that it starts
            ends = {scene: _regenerated(scene, known[scene]) for scene in scenes or known}
    artifacts.publish_batch({scene: (state.name or "", state.message or "") for scene, state in ends.items()})
    bad = [scene for scene, state in ends.items() if not state.is_completed()]
    if bad:
        return Failed(message=f"{len(bad)} of {len(ends)} scenes were not published: {', '.join(bad)}")
    return Completed(message=f"{len(ends)} scenes are as they should be")


def _regenerated(scene: str, entry: SceneEntry | Aug3dError) -> State:
    try:
        if isinstance(entry, Aug3dError):
            raise entry
        return regenerate(scene, entry.config(), return_state=True)
    except Aug3dError as error:  # its own file is wrong
        return Failed(message=f"{error.problem} -> {error.remedy}")


def _wanted(store: Store, entry: SceneEntry, settings: SceneConfig) -> dict[str, str]:
    """Return the key of each step's object, "" where it is not made yet."""
    plan = planned(store, entry.material(), settings)
    return {step.name: record.key if record else "" for step, record in plan}


def _made_of(store: Store, version: Path) -> dict[str, str]:
    return {step: record.key for step, record in records_of(store, version_metrics(version)).items()}


def _make(store: Store, scene: str, entry: SceneEntry, settings: SceneConfig) -> dict[str, Any]:
    material, before = entry.material(), records_before(store, scene)
    check_room(store, scene, material, settings, before, planned(store, material, settings))
    with listening(artifacts.PrefectProgress()):
        return make_version(store, scene, material, entry.preset, settings, before)


def _publish(store: Store, scene: str, entry: SceneEntry, settings: SceneConfig, metrics: Mapping[str, Any]) -> State:
    """Publish a version if it may be; return the state that says what became of it."""
    version, last = Path(metrics["paths"]["metrics"]).parent, published(store, scene)
    compared = beside_published(store, metrics, records_of(store, metrics))
    if compared:
        artifacts.publish_comparison(compared)
    against = held_back(metrics, version_metrics(last) if last else None, entry.publish.most_psnr_drop_db)
    if against:
        return Failed(name=NOT_PUBLISHED, message=f"{version.name} is not published: {against}")
    reached = f"{metrics['nvs']['test_psnr_mean']:.2f} dB on held-out photographs"
    if settings != entry.config():
        why = "it was made with other settings than the scene's file has"
        return Completed(name=TRIED, message=f"{version.name} reaches {reached}; not published: {why}")
    publish(store, scene, version)
    publish_model(store, scene, version.name)
    return Completed(name=PUBLISHED, message=f"{version.name} is published: {reached}")
