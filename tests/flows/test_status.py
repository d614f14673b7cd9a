"""`aug3d status` tells which machine does what, what waits and why, and what it has cost."""

from __future__ import annotations

import asyncio
import json
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock
from typer.testing import CliRunner, Result

from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app
from flows.status import _server_of
from tests.flows.pool_workers import only_these

pytestmark = pytest.mark.slow

STAGES = {
    name: {"seconds": seconds, "cpu_seconds": 2 * seconds, "size_mib": 1.5}
    for name, seconds in {"matching": 7.0, "depth": 100.0, "training": 50.0}.items()
}
SHARED = {"requests": {"get": 3, "put": 4}, "mib_up": 2.0, "mib_down": 1.0}


def run_cli(*words: str) -> Result:
    return CliRunner().invoke(app, [*words])


def written(store: Store, scene: str, stages: dict[str, Any] = STAGES, **more: Any) -> None:
    told = {"scene": scene, "state": "ok", "preset": "tiny", "seconds": 9.0, "peak_mib": 300.0, "stages": stages}
    write_metrics(new_version(store, scene), {**told, "objects": {}, "paths": {}, "shared_store": SHARED, **more})


async def at_work_and_waiting(store: Store) -> dict[str, Any]:
    """Return what is told of a run that a machine is half through depth with, of one behind it, and of one for a GPU."""
    from prefect import task
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.actions import ArtifactCreate
    from prefect.states import Completed, Running, Scheduled

    from flows.deployments import of_scene
    from flows.pool_facts import pool_facts

    @task
    def step() -> None: ...

    async with get_client() as client:
        await only_these(client, ["box status (cpu, home)"])
        deployed = {}
        for name, tags in {"status one": (), "status two": (), "status three": ("gpu",)}.items():
            entry = SceneEntry.model_validate({"photos": None, "tags": tags})
            deployed[name] = await (await of_scene(name.replace(" ", "_"), entry)).aapply()
        due = Scheduled(scheduled_time=datetime.now(UTC) - timedelta(seconds=60))
        runs = [
            await client.create_flow_run_from_deployment(deployed[name], name=name, state=state)
            for name, state in {"status one": Running(), "status two": due, "status three": due}.items()
        ]
        await client.update_flow_run_labels(runs[0].id, {"prefect.worker.name": "box status (cpu, home)"})
        await client.create_task_run(step, runs[0].id, dynamic_key="0", name="matching", state=Completed())
        await client.create_task_run(step, runs[0].id, dynamic_key="1", name="depth", state=Running())
        for name, percent in {"matching": 100.0, "depth": 40.0}.items():
            made = {"key": f"status-{name}", "description": f"{name}: photographs", "data": percent}
            await client.create_artifact(ArtifactCreate(type="progress", flow_run_id=runs[0].id, **made))
        facts = await pool_facts(store)
        for run in runs:
            await client.delete_flow_run(run.id)
    return facts


def test_each_machine_and_each_run_is_told(prefect: None, tmp_path: Path) -> None:
    store = Store(tmp_path)
    written(store, "status_one")
    facts = asyncio.run(at_work_and_waiting(store))
    [machine] = [one for one in facts["machines"] if one["machine"].startswith("box status")]
    assert machine["online"] and machine["queues"] == ["cpu", "home"] and machine["runs"] == ["status one"]
    [run] = [one for one in facts["at_work"] if one["run"] == "status one"]
    assert (run["steps"], run["percent"], run["doing"]) == (["depth"], 40.0, "photographs")
    assert run["machine"] == machine["machine"]
    assert run["left_s"] == 0.6 * STAGES["depth"]["seconds"] + STAGES["training"]["seconds"]
    why = {one["run"]: one["why"] for one in facts["waiting"]}
    assert why["status three"] == "no machine takes runs of the queue gpu"
    assert "are at work" in why["status two"]


def test_nobody_knows_how_long_a_first_run_takes(tmp_path: Path) -> None:
    from flows.pool_facts import _left_s

    assert _left_s(Store(tmp_path), "new", [], ["depth"], 50.0) is None


def test_a_run_that_ended_early_does_not_tell_how_long_a_whole_one_takes(tmp_path: Path) -> None:
    from flows.pool_facts import _left_s

    store = Store(tmp_path)
    written(store, "field", nvs={})
    written(store, "field", {"matching": STAGES["matching"]})
    assert _left_s(store, "field", ["matching"], ["depth"], None) == 150.0


def test_the_cost_of_each_scene_is_told_by_the_command(
    prefect: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(Store(tmp_path), "costly")
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING"):
        monkeypatch.setenv(name, os.environ[name])  # the command sets them
    told = json.loads(run_cli("status", "--json", "--home", str(tmp_path)).stdout)
    sums = {"processor_s": 314.0, "seconds": 157.0, "size_mib": 4.5, "peak_mib": 300.0}
    assert told["scenes"] == [{"scene": "costly", **sums, "shared_store": SHARED}]
    words = run_cli("status", "--home", str(tmp_path)).stdout
    assert "costly" in words and "314" in words and "7 requests (get 3, put 4)" in words


@pytest.fixture
def no_server(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING", "AUG3D_PASSWORD"):
        monkeypatch.setenv(name, "")


@pytest.fixture
def services(tmp_path: Path) -> Path:
    """Return what an `aug3d up` of this home says of itself as long as it serves."""
    services = tmp_path / "services"
    services.mkdir()
    (services / "up.json").write_text(json.dumps({"prefect": "http://127.0.0.1:1", "pid": os.getpid()}))
    (services / "token").write_text("a token")
    (services / "up.lock").touch()
    return services


def test_what_was_killed_serves_nobody_though_its_file_is_left(no_server: None, services: Path) -> None:
    refused = run_cli("status", "--home", str(services.parent))
    assert refused.exit_code == 2 and "no aug3d up serves" in refused.stderr, refused.output


def test_the_server_of_this_home_is_asked_with_its_token(no_server: None, services: Path) -> None:
    with FileLock(services / "up.lock"):
        found = _server_of(Store(services.parent), "", {})
    assert found == {"PREFECT_API_URL": "http://127.0.0.1:1/api", "PREFECT_API_AUTH_STRING": "admin:a token"}


def test_without_a_server_it_says_how_to_get_one(no_server: None, tmp_path: Path) -> None:
    refused = run_cli("status", "--home", str(tmp_path))
    assert refused.exit_code == 2 and "no aug3d up serves" in refused.stderr and "--server" in refused.stderr
