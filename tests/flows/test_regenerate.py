"""A scene of the registry is made again as far as something changed, and published unless it is worse."""

from __future__ import annotations

import asyncio
import json
import shutil
import threading
from collections.abc import Iterator
from contextvars import copy_context
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.run.errors import StoreError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import scene_file, write_scene
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.published import published
from aug3d_core.store.scenes import bring_versions, records_of, version_metrics
from aug3d_core.store.store import Store
from tests.flows.stand_in import FEW, Stages, make_of_few

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]


@pytest.fixture(autouse=True)
def mlflow_is_ready(fresh_mlflow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test a database that is made already: MLflow takes seconds for it."""
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{shutil.copy(fresh_mlflow, tmp_path)}")


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stand_in = Stages(folds=1)
    monkeypatch.setattr("tasks.build_task.build", stand_in.build)
    make_of_few(monkeypatch)
    return stand_in


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    return Store(tmp_path / "home")


def add_scene(store: Store, scene: str) -> SceneEntry:
    folder = store.root.parent / scene
    folder.mkdir()
    (folder / "a.jpg").write_text(scene)
    entry = SceneEntry(photos=folder)
    write_scene(store, scene, entry)
    return entry


def end_of(scene: str, entry: SceneEntry, **changed: object):
    from flows.regenerate import regenerate

    settings = entry.config()
    training = settings.training.model_copy(update=changed)
    return regenerate(scene, settings.model_copy(update={"training": training}), return_state=True)


def versions(store: Store, scene: str) -> int:
    return len(list((store.root / layout.SCENES / scene).glob(f"*/{layout.METRICS}")))


def test_only_what_changed_is_made_and_only_what_is_no_worse_is_published(stages: Stages, store: Store) -> None:
    entry = add_scene(store, "little")
    first = end_of("little", entry)
    assert (first.name, first.is_completed()) == ("Published", True)
    assert set(stages.computed) == {stage.name for stage in FEW}
    good = published(store, "little")
    stages.computed.clear()

    unchanged = end_of("little", entry)
    assert (unchanged.name, unchanged.is_completed(), stages.computed) == ("Unchanged", True, [])
    assert versions(store, "little") == 1, "not even a version is made"

    stages.psnr_db = 19.0
    worse = end_of("little", entry, steps=7)
    assert (worse.name, worse.is_failed()) == ("NotPublished", True), worse.message
    assert "PSNR fell by 1.00 dB, from 20.00 to 19.00 dB; at most 0.5 dB may be lost" in (worse.message or "")
    assert stages.computed == ["training", "evaluation"]
    assert published(store, "little") == good and versions(store, "little") == 2

    stages.computed.clear()
    assert end_of("little", entry, steps=7).name == "NotPublished" and stages.computed == []
    assert versions(store, "little") == 2, "it is judged again, not made again"

    stages.psnr_db = 19.6
    tried = end_of("little", entry, steps=8)
    assert tried.name == "Tried" and "reaches 19.60 dB" in (tried.message or "")
    assert published(store, "little") == good, "a trial in the form changes nothing for others"

    scene_file(store, "little").write_text(f"photos: {entry.photos}\nsettings: {{training: {{steps: 8}}}}\n")
    stages.computed.clear()
    now_meant = end_of("little", entry, steps=8)
    assert now_meant.name == "Published" and stages.computed == []
    now = published(store, "little")
    assert now is not None and now != good
    told = json.loads((now / layout.METRICS).read_bytes())["stages"]
    assert told["training"]["why"][0].startswith("steps ") and told["photos"]["why"] == []
    assert good is not None and good.name in (now / layout.REPORT).read_text(), "the report compares with it"


@pytest.mark.parametrize("old_stays", [False, True])
def test_a_home_that_was_moved_publishes_its_own_versions(
    stages: Stages, store: Store, monkeypatch: pytest.MonkeyPatch, old_stays: bool
) -> None:
    entry = add_scene(store, "little")
    assert end_of("little", entry).name == "Published"
    (store.root / layout.SCENES / "little" / layout.PUBLISHED).unlink()
    moved = store.root.with_name("moved")
    (shutil.copytree if old_stays else shutil.move)(store.root, moved)
    monkeypatch.setenv("AUG3D_HOME", str(moved))
    end = end_of("little", entry)
    assert end.name == "Published", end.message
    now = published(Store(moved), "little")
    assert now is not None and now.is_relative_to(moved)
    assert store.root.exists() == old_stays and (not old_stays or published(store, "little") is None)


def seen_elsewhere(store: Store) -> Path | None:
    """Return the published version as a machine that made nothing sees it."""
    other = Store(store.root.parent / "elsewhere")
    bring_versions(other, "little")
    return published(other, "little")


def test_a_version_that_other_machines_were_not_told_of_is_told_before_it_is_published(
    stages: Stages, store: Store, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(*_: object) -> None:
        raise StoreError("the shared store is away", "wait")

    entry = add_scene(store, "little")
    with monkeypatch.context() as patched:
        patched.setattr("flows.factory.share_version", away)
        assert end_of("little", entry).is_failed() and versions(store, "little") == 1
    assert seen_elsewhere(store) is None
    assert end_of("little", entry).name == "Published" and versions(store, "little") == 1
    version = published(Store(store.root), "little")
    assert version and (version / layout.TOLD).exists()
    there = seen_elsewhere(store)
    assert there and there.name == version.name

    (version / layout.TOLD).unlink()  # others once got the pointer alone
    Bucket(shared).delete(Bucket(shared).names(f"scenes/little/{version.name}/"))
    assert end_of("little", entry).name == "Unchanged"
    assert Bucket(shared).has(f"scenes/little/{version.name}/{layout.METRICS}")


def test_a_version_older_than_the_shared_store_is_shared_when_it_is_published(
    stages: Stages, store: Store, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = add_scene(store, "little")
    assert end_of("little", entry).name == "Published"
    (store.root / layout.SCENES / "little" / layout.PUBLISHED).unlink()
    monkeypatch.setenv("AUG3D_STORE", bucket)
    assert end_of("little", entry).name == "Published"
    there = seen_elsewhere(store)
    assert there and versions(store, "little") == 1
    files = Bucket(bucket).names(f"scenes/little/{there.name}/")
    assert {Path(name).name for name in files} == {layout.METRICS, layout.REPORT}
    assert set(records_of(Store(there.parents[2]), version_metrics(there))) == {stage.name for stage in FEW}


@pytest.fixture
def workers(store: Store, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Take runs of scenes as workers do, but in this process, which has the stand-in stages; return what they took."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterDeploymentId
    from prefect.flow_engine import run_flow

    from flows import ends, regenerate
    from flows.pool import make_pool
    from flows.takeover import unfinished
    from flows.worker import register

    monkeypatch.setattr(ends, "_ASK_EVERY_S", 0.2)
    ended, took = threading.Event(), []
    entries = {scene: add_scene(store, scene) for scene in ("a_torn", "b_gone", "c_good")}

    async def registered() -> None:
        async with get_client() as client:
            await make_pool(client)
        await register(store, None)

    def work() -> None:
        with get_client(sync_client=True) as client:
            while not ended.wait(0.1):
                due = FlowRunFilter(state=unfinished(), deployment_id=FlowRunFilterDeploymentId(is_null_=False))
                for run in client.read_flow_runs(flow_run_filter=due):
                    if run.parameters.get("scene") not in entries:
                        continue  # another test left it on this server
                    took.append(run.parameters["scene"])
                    given = regenerate.regenerate.validate_parameters(run.parameters)
                    run_flow(regenerate.regenerate, flow_run=run, parameters=given, return_type="state")

    asyncio.run(registered())
    # With this thread's settings: without them Prefect starts a server of its own there, and imports it beside this thread
    thread = threading.Thread(target=copy_context().run, args=(work,))
    thread.start()
    yield took
    ended.set()
    thread.join()


def test_a_scene_that_fails_does_not_stop_the_others(stages: Stages, store: Store, workers: list[str]) -> None:
    from flows.regenerate import batch

    scene_file(store, "a_torn").write_text("photos: [")
    shutil.rmtree(store.root.parent / "b_gone")
    end = batch(return_state=True)
    assert end.is_failed() and "2 of 3 scenes were not published: a_torn, b_gone" in (end.message or "")
    assert published(store, "c_good") and not published(store, "b_gone")
    assert sorted(workers) == ["b_gone", "c_good"], "each has a run of its own, which any worker may take"
    again = batch(["c_good"], return_state=True)
    assert again.is_completed() and "1 scenes are up to date" in (again.message or "")
    assert "'nowhere' is not registered" in (batch(["nowhere"], return_state=True).message or "")


def test_a_batch_whose_process_ended_waits_for_the_runs_that_it_had_started(
    stages: Stages, store: Store, workers: list[str]
) -> None:
    from prefect import flow
    from prefect.deployments import run_deployment

    from flows import regenerate

    @flow
    def torn() -> list[str]:
        left = run_deployment("regenerate/c_good", timeout=0)
        ends = regenerate._regenerated({"c_good": SceneEntry(photos=store.root.parent / "c_good")})
        return [str(left.id), ends["c_good"].name or ""]

    assert torn()[1] == "Published" and workers == ["c_good"]


def test_cancelling_a_batch_cancels_what_it_started(store: Store) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.deployments import run_deployment
    from prefect.states import Running

    from flows.deployments import of_scene
    from flows.pool import make_pool
    from flows.regenerate import cancel_parts

    async def registered() -> None:
        async with get_client() as client:
            await make_pool(client)
        await (await of_scene("waits", SceneEntry(photos=None))).aapply()

    @flow
    def parent() -> list[Any]:
        return [run_deployment("regenerate/waits", timeout=0).id for _ in range(2)]

    async def cancelled() -> list[str]:
        async with get_client() as client:
            await client.set_flow_run_state(ids[1], Running(), force=True)
            whole = await client.read_flow_run(state.state_details.flow_run_id)
            await cancel_parts(parent, whole, state)
            return [(await client.read_flow_run(each)).state.name for each in ids]

    asyncio.run(registered())
    state = parent(return_state=True)
    ids = state.result()
    assert asyncio.run(cancelled()) == ["Cancelled", "Cancelling"]
