"""Photographs and poses that only the machine of a scene's file has: another makes the scene of what that one read."""

from __future__ import annotations

import asyncio
import os
import shutil
import threading
from collections.abc import Iterator
from contextvars import copy_context
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.factory.material import Elsewhere, Material
from aug3d_core.factory.stages import POSES
from aug3d_core.photos.discover import find_photos, folder_digest
from aug3d_core.poses.recognise import TRANSFORMS as POSE_FILE
from aug3d_core.poses.recognise import pose_digest
from aug3d_core.run.errors import InputError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_scene, write_scene
from aug3d_core.scene_files.mirror import bring, share, told_photographs
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store
from tests.flows.stand_in import FEW, Stages, stand_in

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]
SCENE = "far_away"
WITH_POSES = (FEW[0], replace(POSES, inputs=("photos", "given")), *FEW[1:])
MOUNTED = threading.Lock()  # held while the disk is where the scene's file says


@pytest.fixture
def stages(fresh_mlflow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stages:
    made = stand_in(monkeypatch, fresh_mlflow, tmp_path)
    monkeypatch.setattr(Material, "stages", lambda _: WITH_POSES)
    return made


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    """Return a disk with photographs and poses, which the machine of the scene's file mounts only while it works."""
    folder = tmp_path / "disk"
    folder.mkdir()
    (folder / "a.jpg").write_bytes(b"a photograph")
    (folder / POSE_FILE).write_text("{}")
    return folder


@pytest.fixture
def there(
    tmp_path: Path, shared: str, stages: Stages, disk: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Store, SceneEntry]]:
    """Return the store of a worker that lacks the photographs, and the scene; the machine that has them is at work."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterDeploymentId
    from prefect.flow_engine import run_flow

    from flows import ends
    from flows.deployments import of_everything
    from flows.photographs import read_photographs
    from flows.pool import REGISTRIES, make_pool
    from flows.takeover import unfinished

    monkeypatch.setattr(ends, "_ASK_EVERY_S", 0.2)
    mount, ended = tmp_path / "photos", threading.Event()
    here, there = Store(tmp_path / "here"), Store(tmp_path / "there")
    write_scene(here, SCENE, SceneEntry(photos=mount, poses=mount / POSE_FILE))
    share(here, Bucket(shared), REGISTRIES)
    bring(there, Bucket(shared), REGISTRIES)
    monkeypatch.setenv("AUG3D_HOME", str(there.root))

    async def registered() -> None:
        async with get_client() as client:
            await make_pool(client)
        async for deployment in of_everything():
            await deployment.aapply()

    def work() -> None:
        due = FlowRunFilter(state=unfinished(), deployment_id=FlowRunFilterDeploymentId(is_null_=False))
        with get_client(sync_client=True) as client:
            while not ended.wait(0.1):
                for run in client.read_flow_runs(flow_run_filter=due):
                    if run.parameters.get("scene") == SCENE and run.work_queue_name == "photographs":
                        given = read_photographs.validate_parameters(run.parameters)
                        with MOUNTED:
                            os.environ["AUG3D_HOME"] = str(here.root)  # the other one waits meanwhile
                            if disk.exists():
                                disk.rename(mount)
                            run_flow(read_photographs, flow_run=run, parameters=given, return_type="state")
                            if mount.exists():
                                mount.rename(disk)
                            os.environ["AUG3D_HOME"] = str(there.root)

    asyncio.run(registered())
    thread = threading.Thread(target=copy_context().run, args=(work,))
    thread.start()
    yield there, read_scene(there, SCENE)
    ended.set()
    thread.join()


def as_read(disk: Path) -> Elsewhere:
    return Elsewhere(photos=folder_digest(disk), photo_count=len(find_photos(disk).names), poses=pose_digest(disk))


def end_of(entry: SceneEntry) -> Any:
    from flows.regenerate import regenerate

    state = regenerate(SCENE, entry.config(), return_state=True)
    with MOUNTED:
        return state


def test_a_machine_without_them_makes_the_scene(
    there: tuple[Store, SceneEntry], shared: str, stages: Stages, disk: Path
) -> None:
    store, entry = there
    first = end_of(entry)
    assert (first.name, sorted(stages.computed)) == ("Published", sorted(stage.name for stage in WITH_POSES)), (
        first.message
    )
    assert told_photographs(Bucket(shared), SCENE) == as_read(disk)
    assert [*(store.root / "objects" / "photos").glob("*/record.json")], "it came from the store"

    stages.computed.clear()
    assert (end_of(entry).name, stages.computed) == ("Unchanged", [])
    (disk / "b.jpg").write_bytes(b"another photograph")
    assert end_of(entry).name == "Published"
    assert "photos" in stages.computed, "they are read as they are now"
    stages.computed.clear()
    (disk / POSE_FILE).write_text("{ }")
    end_of(entry)
    assert "poses" in stages.computed and "photos" not in stages.computed


def test_whoever_helps_asks_nobody(there: tuple[Store, SceneEntry], disk: Path) -> None:
    from flows.photographs import known_material

    store, entry = there
    with pytest.raises(InputError, match="photos"):
        known_material(store, SCENE, entry)
    end_of(entry)
    material = known_material(store, SCENE, entry)
    assert (material.photos, material.elsewhere) == (entry.photos, as_read(disk))


def test_where_nobody_has_them_the_run_names_the_folder(there: tuple[Store, SceneEntry], disk: Path) -> None:
    shutil.rmtree(disk)
    end = end_of(there[1])
    assert end.is_failed()
    for words in (str(there[1].photos), "not on this machine", "could not be read where its file is"):
        assert words in (end.message or ""), end.message


def test_the_machine_of_the_scene_file_asks_nobody(tmp_path: Path, shared: str) -> None:
    from flows.photographs import material_of

    store, entry = Store(tmp_path / "here"), SceneEntry(photos=tmp_path / "gone")
    write_scene(store, SCENE, entry)
    with pytest.raises(InputError, match="gone"):
        material_of(store, SCENE, entry, entry.config())
