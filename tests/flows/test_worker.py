"""The worker follows the registry, takes over what nobody works on, and makes up for missed schedules once."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Coroutine, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each, remove_scene, scene_file, write_scene
from aug3d_core.scene_files.mirror import bring
from aug3d_core.scene_files.schedule import Schedule
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]

_FLOW = """
import os
from prefect import flow
from prefect.runtime import flow_run
from prefect.states import Completed

@flow
def told():
    return Completed(message=f"of {os.getppid()}, supervised {os.environ['AUG3D_SUPERVISED']}")

@flow
def killed_once():
    if flow_run.run_count == 1:
        os.kill(os.getpid(), 9)
    return Completed(message=f"start {flow_run.run_count}")
"""


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    from flows.pool import make_pool

    async def pool() -> None:
        from prefect.client.orchestration import get_client

        async with get_client() as client:
            await make_pool(client)

    run(pool())
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    return Store(tmp_path)


def run(work: Coroutine[Any, Any, Any]) -> Any:
    return asyncio.run(work)


def scene(**changed: Any) -> SceneEntry:
    return SceneEntry.model_validate({"photos": None, "description": "a town", **changed})


async def deployments() -> dict[str, Any]:
    from prefect.client.orchestration import get_client

    async with get_client() as client:
        return {deployment.name: deployment for deployment in await client.read_deployments()}


def test_deployments_follow_the_registry(
    store: Store, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from flows import takeover
    from flows.worker import register

    monkeypatch.setattr(takeover, "PAGE", 1)
    write_scene(store, "one", scene(schedule=Schedule(cron="0 3 * * 1", timezone="Europe/Warsaw")))
    write_scene(store, "two", scene(settings={"training": {"steps": 77}}, tags=("old",)))

    async def follow() -> tuple[dict[str, Any], ...]:
        known = await register(store, None)
        before = await deployments()
        remove_scene(store, "one")
        scene_file(store, "two").write_text("photos: null\npreset: huge\n")
        await register(store, known)
        return before, await deployments()

    before, after = run(follow())
    [schedule] = before["one"].schedules
    assert (schedule.schedule.cron, schedule.schedule.timezone, schedule.active) == ("0 3 * * 1", "Europe/Warsaw", True)
    assert before["two"].parameters["settings"]["training"]["steps"] == 77
    assert before["two"].parameter_openapi_schema["properties"]["scene"]["enum"] == ["two"]
    assert set(before["two"].tags) == {"aug3d", "scene", "tiny", "old"}
    assert "one" not in after and after["two"].parameters == before["two"].parameters, "a torn file changes nothing"
    assert "two.yaml:2: preset" in capsys.readouterr().out


def test_the_form_says_what_each_setting_is_and_keeps_the_order_of_the_stages(store: Store) -> None:
    from flows.deployments import of_scene

    form = run(of_scene("one", scene()))._parameter_openapi_schema.model_dump()
    assert list(form["definitions"]["SceneConfig"]["properties"]) == list(scene().config_values())
    assert form["definitions"]["TrainingConfig"]["properties"]["groups_per_step"]["minimum"] == 1
    for name, model in form["definitions"].items():
        for field, said in model.get("properties", {}).items():
            assert said.get("description"), f"{name}.{field} tells what it is"
            assert said.get("title", field) == field, "a form calls it what files and --set call it"


def test_runs_without_a_process_are_taken_over(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.states import Cancelling, Completed, Running

    from flows import takeover
    from flows.deployments import of_scene
    from tasks.run_locks import run_lock

    monkeypatch.setattr(takeover, "PAGE", 1)

    @flow
    def nothing(home: str = "") -> None: ...

    async def ends() -> list[str]:
        async with get_client() as client:
            states = Running(), Cancelling(), Completed(), Running()
            ours = {"parameters": {"home": str(store.root)}, "tags": ["aug3d"]}
            runs = [await client.create_flow_run(nothing, state=state, **ours) for state in states]
            deployment = await (await of_scene("taken", scene())).aapply()
            runs.append(await client.create_flow_run_from_deployment(deployment, state=Running()))
            for others in ({"parameters": {"home": "/elsewhere"}, "tags": ["aug3d"]}, {"tags": ["theirs"]}):
                runs.append(await client.create_flow_run(nothing, state=Running(), **others))
            with run_lock(store.root, str(runs[3].id)):
                await takeover.take_over(client, store)
            return [(await client.read_flow_run(made.id)).state.name for made in runs]

    assert run(ends()) == [
        "Crashed", "Cancelled", "Completed", "Running", "AwaitingRetry",  # ours
        "Running", "Running",  # of another home, and of others
    ]  # fmt: skip


@pytest.fixture(scope="module")
def service() -> Iterator[str]:
    with s3_service() as address:
        yield address


@pytest.fixture
def shared(service: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bucket:
    """Let stores be shared, and leases lapse soon."""
    from aug3d_core.store import lease

    for name, value in {**KEYS, "AWS_ENDPOINT_URL": service}.items():
        monkeypatch.setenv(name, value)
    for name, seconds in {"RENEW_S": 0.2, "LAPSED_S": 2.0, "_SEEN_S": 1.0}.items():
        monkeypatch.setattr(lease, name, seconds)
    monkeypatch.setenv("AUG3D_STORE", f"s3://{BUCKET}/{tmp_path.name}")
    return Bucket(os.environ["AUG3D_STORE"])


async def at_work(client: Any, home: Store) -> list[Any]:
    from flows.takeover import AT_WORK, our_runs

    return await our_runs(client, home, *AT_WORK)


def test_runs_that_no_machine_works_on_are_taken_over_once(shared: Bucket, store: Store, tmp_path: Path) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Cancelling, Pending, Running

    from aug3d_core.store.lease import Watch, lease
    from flows import takeover
    from flows.deployments import of_scene

    async def ends() -> tuple[list[str], list[str], int]:
        async with get_client() as client:
            deployment = await (await of_scene("taken", scene())).aapply()
            states = Running(), Pending(), Cancelling(), Running()
            runs = [await client.create_flow_run_from_deployment(deployment, state=state) for state in states]
            homes = [Store(tmp_path / name) for name in ("one", "two")]
            watches = [Watch(shared) for _ in homes]
            shared.create(f"leases/{takeover.lease_of(runs[0].id)}/00000000", b'{"host": "gone", "owner": "gone"}')
            with lease(shared, takeover.lease_of(runs[3].id), lambda: False, lambda host: None):
                await takeover.take_over(client, store)
                before = [(await client.read_flow_run(made.id)).state.name for made in runs]
                for _ in range(8):
                    for home, watch in zip(homes, watches, strict=True):
                        await takeover.take_over_from_others(client, watch, await at_work(client, home))
                    await asyncio.sleep(0.5)
                after = [(await client.read_flow_run(made.id)).state.name for made in runs]
            told = await client.read_flow_run_states(runs[0].id)
        return before, after, [state.name for state in told].count("AwaitingRetry")

    before, after, times = run(ends())
    assert before == ["Running", "Pending", "Cancelling", "Running"], "another machine may work on them"
    assert after == ["AwaitingRetry", "AwaitingRetry", "Cancelled", "Running"]
    assert times == 1


def test_the_parts_of_a_run_that_is_taken_over_end_with_it(shared: Bucket, store: Store) -> None:
    from prefect import flow, task
    from prefect.client.orchestration import get_client
    from prefect.states import Running

    from aug3d_core.store.lease import Watch
    from flows import takeover
    from flows.deployments import of_scene

    @task
    def starts_a_part() -> None: ...

    @flow
    def part() -> None: ...

    async def ends() -> list[str]:
        async with get_client() as client:
            deployment = await (await of_scene("whole", scene())).aapply()
            made = await client.create_flow_run_from_deployment(deployment, state=Running())
            step = await client.create_task_run(starts_a_part, made.id, dynamic_key="0", state=Running())
            inner = await client.create_flow_run(part, parent_task_run_id=step.id, state=Running(), tags=["aug3d"])
            watch = Watch(shared)
            for _ in range(8):
                await takeover.take_over_from_others(client, watch, await at_work(client, store))
                await asyncio.sleep(0.5)
            return [(await client.read_flow_run(each)).state.name for each in (made.id, inner.id)]

    assert run(ends()) == ["AwaitingRetry", "Crashed"]


def test_a_run_that_is_not_cancelled_in_time_is_ended(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.states import Cancelling

    from flows import takeover

    @flow
    def nothing() -> None: ...

    async def state_and_process() -> tuple[str, int | None]:
        async with get_client() as client:
            await takeover.end_cancelled(client, store, await at_work(client, store))
            return (await client.read_flow_run(made.id)).state.name, process.poll()

    async def make() -> Any:
        async with get_client() as client:
            return await client.create_flow_run(nothing, state=Cancelling(), tags=["aug3d"])

    made = run(make())
    process = subprocess.Popen(["sleep", "60"], env={**os.environ, "PREFECT__FLOW_RUN_ID": str(made.id)})
    try:
        assert run(state_and_process()) == ("Cancelling", None), "the runner has its time"
        monkeypatch.setattr(takeover, "CANCELLED_WITHIN_S", 0.0)
        assert run(state_and_process())[0] == "Cancelled"
        assert process.wait(60) == -signal.SIGKILL
    finally:
        process.kill()
        process.wait()


def test_a_run_that_another_machine_cancels_is_left_to_it(
    shared: Bucket, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.states import Cancelling

    from flows import takeover

    @flow
    def nothing() -> None: ...

    async def state() -> str:
        async with get_client() as client:
            made = await client.create_flow_run(nothing, state=Cancelling(), tags=["aug3d"])
            await takeover.end_cancelled(client, store, await at_work(client, store))
            return (await client.read_flow_run(made.id)).state.name

    monkeypatch.setattr(takeover, "CANCELLED_WITHIN_S", 0.0)
    assert run(state()) == "Cancelling", "its process may live there"


def test_what_is_registered_is_known_to_other_machines_and_goes_to_its_queue(
    shared: Bucket, store: Store, tmp_path: Path
) -> None:
    from flows.pool import REGISTRIES
    from flows.worker import register

    write_scene(store, "light", scene())
    write_scene(store, "heavy", scene(tags=("gpu",)))

    async def queues() -> dict[str, str]:
        known = await register(store, None)
        bring(other, shared, REGISTRIES)
        assert set(read_each(other)) == {"light", "heavy"}
        remove_scene(store, "light")
        await register(store, known)
        bring(other, shared, REGISTRIES)
        assert set(read_each(other)) == {"heavy"}
        return {name: made.work_queue_name for name, made in (await deployments()).items()}

    other = Store(tmp_path / "other")
    assert run(queues())["heavy"] == "gpu"
    write_scene(store, "light", scene())
    assert run(register(store, None)) and run(deployments())["light"].work_queue_name == "cpu"


def test_the_machine_of_the_pages_takes_what_it_is_asked_for_by_name(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others ask it for shares of studies and for help as they ask any machine that takes runs: by its own queue."""
    from flows import worker
    from flows.pool import POOL, machine, queues_of

    began: list[Any] = []

    async def nothing(*services: Coroutine[Any, Any, Any]) -> None:
        for service in services:
            service.close()

    async def watched() -> None:
        """Watch nothing."""

    monkeypatch.setattr(worker, "work_until_ended", nothing)
    monkeypatch.setattr(worker, "watch_runs", lambda _, workers: began.extend(workers) or watched())
    monkeypatch.setattr(worker, "tell_ready", lambda home: None)
    run(worker._work(store))

    async def queues() -> set[str]:
        from prefect.client.orchestration import get_client

        async with get_client() as client:
            return {queue.name for queue in await client.read_work_queues(work_pool_name=POOL)}

    [first, _] = began
    assert machine(store) in first._work_queues and "cpu" in queues_of(first.name)
    assert machine(store) in run(queues())


def test_what_cannot_be_reached_now_is_asked_again(
    store: Store, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A worker that ended when Prefect is away would take with it what it executes."""
    import httpx

    from aug3d_core.run.errors import StoreError
    from flows import pool

    monkeypatch.setattr(pool, "_LOOK_EVERY_S", 0.01)
    answers = iter(
        [httpx.ConnectError("refused"), StoreError("the store is away", "wait"), None, ValueError("a mistake")]
    )

    async def look(_: object) -> None:
        if (answer := next(answers)) is not None:
            raise answer

    with pytest.raises(ValueError, match="a mistake"):
        run(pool.again_and_again(look))
    assert "refused" in capsys.readouterr().out


def written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process and those of runs find the flows of these tests."""
    (folder / "flow_of_a_test.py").write_text(_FLOW)
    monkeypatch.delitem(sys.modules, "flow_of_a_test", raising=False)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(Path(__file__).parents[2])]))


async def begun(name: str) -> Any:
    """Deploy a flow of these tests, and return the id of a run of it that waits for a worker of the home."""
    import flow_of_a_test  # type: ignore[import-not-found]
    from prefect.client.orchestration import get_client
    from prefect.types.entrypoint import EntrypointType

    from flows.pool import HOME_QUEUE, POOL

    made = await getattr(flow_of_a_test, name).ato_deployment(
        name, work_pool_name=POOL, work_queue_name=HOME_QUEUE, entrypoint_type=EntrypointType.MODULE_PATH
    )
    deployment = await made.aapply()
    async with get_client() as client:
        return (await client.create_flow_run_from_deployment(deployment)).id


async def ended(flow_run: Any) -> Any:
    from prefect.client.orchestration import get_client

    async with get_client() as client:
        return await client.read_flow_run(flow_run)


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)  # Prefect leaves a socket open where it dies
def test_a_run_whose_process_is_killed_goes_on(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from flows.pool import HOME_QUEUE, PoolWorker

    written(tmp_path, monkeypatch)

    async def executed() -> list[Any]:
        run, seen = await begun("killed_once"), []
        for _ in range(2):
            await PoolWorker(store, (HOME_QUEUE,), 1).start(run_once=True)
            seen.append(await ended(run))
        return seen

    first, last = run(executed())
    gc.collect()
    assert (first.state.name, last.state.name, last.run_count) == ("AwaitingRetry", "Completed", 2)


def test_a_run_that_is_killed_each_time_is_given_up(store: Store) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Crashed, Pending, Running

    from flows import takeover
    from flows.deployments import of_scene

    async def states() -> list[tuple[bool, str]]:
        seen = []
        async with get_client() as client:
            deployment = await (await of_scene("killed", scene())).aapply()
            run = (await client.create_flow_run_from_deployment(deployment)).id
            for state in (Running(), Pending(), Crashed(), Running()):  # one start ended before it ran
                await client.set_flow_run_state(run, state, force=True)
                in_line = await takeover.put_back(client, run)
                seen.append((in_line, (await client.read_flow_run(run)).state.name))
        return seen

    assert run(states()) == [(True, "AwaitingRetry")] * 2 + [(False, "Crashed"), (False, "Running")]


def test_a_run_that_its_worker_has_lost_is_put_back(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """As after a server that was away just when the run was begun."""
    from prefect.client.orchestration import get_client
    from prefect.states import Pending, Running

    from flows import watched_runs
    from flows.deployments import of_scene
    from flows.pool import HOME_QUEUE, WORKER, PoolWorker
    from tasks.run_locks import run_lock

    monkeypatch.setattr(watched_runs, "STRANDED_S", 0.5)
    worker = PoolWorker(store, (HOME_QUEUE,), 1)

    async def states() -> list[list[str]]:
        async with get_client() as client:
            deployment = await (await of_scene("stranded", scene())).aapply()
            names = ("lost", "lost early", "executed", "has a process", "of another")
            runs = {
                name: (
                    await client.create_flow_run_from_deployment(
                        deployment, state=Pending() if name == "lost early" else Running()
                    )
                ).id
                for name in names
            }
            for name, each in runs.items():
                await client.update_flow_run_labels(each, {WORKER: "box (home)" if "another" in name else worker.name})
            worker.executed.add(runs["executed"])
            seen, watch = [], watched_runs.Stranded(store, (worker,))
            with run_lock(store.root, str(runs["has a process"])):
                for _ in range(2):
                    await watch.look(client, await at_work(client, store))
                    found = {name: await client.read_flow_run(each) for name, each in runs.items()}
                    seen.append([name for name, each in found.items() if each.state.name == "AwaitingRetry"])
                    await asyncio.sleep(0.6)
            return seen

    assert run(states()) == [[], ["lost", "lost early"]]


def test_a_run_that_cannot_be_begun_now_stays_in_line(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import httpx

    from flows.pool import HOME_QUEUE, PoolWorker

    written(tmp_path, monkeypatch)
    busy = [httpx.ReadTimeout("Prefect is busy")]

    async def labels(self: Any, flow_run: Any) -> None:
        if busy:
            raise busy.pop()

    monkeypatch.setattr(PoolWorker, "_give_worker_labels_to_flow_run", labels)

    async def executed() -> list[Any]:
        run, seen = await begun("told"), []
        for _ in range(2):
            await PoolWorker(store, (HOME_QUEUE,), 1).start(run_once=True)
            seen.append((await ended(run)).state.name)
        return seen

    assert run(executed()) == ["AwaitingRetry", "Completed"]


def test_prefect_is_asked_for_runs_when_one_is_due_and_there_is_room(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Scheduled

    from flows import pool
    from flows.deployments import of_scene

    asked: list[str] = []
    now = ""

    async def ask(self: Any) -> list[Any]:
        asked.append(now)
        return []

    monkeypatch.setattr(pool.PoolWorker, "_get_scheduled_flow_runs", ask)

    async def look() -> None:
        nonlocal now
        async with get_client() as client, pool.PoolWorker(store, ("rare",), 1) as worker:
            await pool.make_queue(client, "rare")
            await worker.sync_with_backend()
            deployment = await (await of_scene("waits", scene())).aapply()

            async def wait_since(hours: float) -> Any:
                state = Scheduled(scheduled_time=datetime.now(UTC) + timedelta(hours=hours))
                return await client.create_flow_run_from_deployment(deployment, state=state, work_queue_name="rare")

            for now in ("at first", "for nothing", "due in an hour", "due", "full", "seen long ago"):
                if now.startswith("due"):
                    waits = await wait_since(1.0 if now == "due in an hour" else 0.0)
                if now == "full":
                    worker.limiter.acquire_on_behalf_of_nowait(waits.id)
                if now == "seen long ago":
                    monkeypatch.setattr(pool, "_SEEN_EVERY_S", 0.0)
                await worker.get_and_submit_flow_runs()
            worker.limiter.release_on_behalf_of(waits.id)

    run(look())
    assert asked == ["at first", "due", "seen long ago"]


def test_a_run_that_was_cancelled_or_failed_stays_so(store: Store) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Cancelled, Cancelling, Completed, Failed

    from flows import takeover
    from flows.deployments import of_scene

    async def put_back() -> list[bool]:
        async with get_client() as client:
            deployment = await (await of_scene("ended", scene())).aapply()
            states = Cancelled(), Cancelling(), Completed(), Failed()
            runs = [await client.create_flow_run_from_deployment(deployment, state=state) for state in states]
            return [await takeover.put_back(client, made.id) for made in runs]

    assert run(put_back()) == [False] * 4


def test_a_worker_executes_a_run_under_its_lease(
    shared: Bucket, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run's process is one of its own, and dies with the worker's."""
    from flows.pool import HOME_QUEUE, PoolWorker

    written(tmp_path, monkeypatch)
    leases: list[str] = []

    async def executed() -> Any:
        run = await begun("told")
        worker = PoolWorker(
            store, (HOME_QUEUE,), 1, before=lambda: leases.append(",".join(shared.names("leases/runs/")))
        )
        await worker.start(run_once=True)
        return await ended(run)

    done = run(executed())
    assert done.state.is_completed(), done.state.message
    assert f"of {os.getpid()}, supervised {os.getpid()}" in done.state.message
    assert leases == [f"leases/runs/{done.id}/00000000"] and shared.names("leases/") == []
    assert "(home)" in done.labels["prefect.worker.name"]


def test_of_the_missed_runs_one_makes_up_for_all(store: Store) -> None:
    from prefect.client.orchestration import get_client

    from flows.deployments import of_scene
    from flows.takeover import one_of_the_missed

    if time.time() % 600 > 580 or time.time() % 600 < 10:
        time.sleep(30)  # a run that is due just now is neither missed nor to come

    async def scheduled() -> list[tuple[datetime, str]]:
        deployment = await (await of_scene("one", scene(schedule=Schedule(every="10m")))).aapply()
        now = datetime.now(UTC)
        times = {"start_time": str(now - timedelta(hours=1)), "end_time": str(now + timedelta(minutes=25))}
        async with get_client() as client:
            await client._client.post(f"/deployments/{deployment}/schedule", json=times)
            await one_of_the_missed(client, store)
            runs = [made for made in await client.read_flow_runs() if made.deployment_id == deployment]
        return sorted((made.expected_start_time, made.state.name) for made in runs)

    told = run(scheduled())
    past = [name for time, name in told if time < datetime.now(UTC)]
    assert len(past) >= 5 and past[-1] in ("Scheduled", "Late") and set(past[:-1]) == {"Cancelled"}
    assert {name for time, name in told if time > datetime.now(UTC)} == {"Scheduled"}
