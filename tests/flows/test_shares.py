"""Work of a shared store begins a run for each machine that can take part, and ends these runs with itself."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Coroutine
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest

import aug3d_core.studies.stability.catalogue  # noqa: F401  (a study brings Open3D with it: tests/processes.py must see it)
from aug3d_core.factory.build import Work
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import DEPTH, GROUPING
from aug3d_core.factory.walk import Make, Visit, planned
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Progress, Stage
from aug3d_core.scene_files import SceneEntry, write_scene
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.stability.cell import Dosed, StabilityResult
from aug3d_core.town.config import TownConfig
from tests.flows.pool_workers import only_these

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]


def run(work: Coroutine[Any, Any, Any]) -> Any:
    return asyncio.run(work)


@pytest.fixture
def pool(tmp_path: Path) -> Store:
    """Let two other machines and this one take runs; a third serves another queue."""

    async def make() -> None:
        from prefect.client.orchestration import get_client

        from flows.deployments import of_everything
        from flows.pool import machine, make_queue

        async with get_client() as client:
            mine = machine(Store(tmp_path))
            names = "box one (cpu, gpu)", "box two (cpu)", "box three (gpu)", f"{mine} (cpu, home)", f"{mine} (batch)"
            await only_these(client, names)
            for name in ("box one", "box two"):
                await make_queue(client, name)
        async for deployment in of_everything():
            await deployment.aapply()

    run(make())
    return Store(tmp_path)


async def shares(study: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Return state, queue and parameters of the runs that a study began."""
    from uuid import UUID

    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterParentFlowRunId

    begun = FlowRunFilter(parent_flow_run_id=FlowRunFilterParentFlowRunId(any_=[UUID(study)]))
    async with get_client() as client:
        found = await client.read_flow_runs(flow_run_filter=begun)
    return [(one.state_name or "", one.work_queue_name or "", one.parameters) for one in found if one.deployment_id]


def begun_and_left(store: Store, times: int = 1) -> tuple[str, list[Any], list[Any]]:
    """Run a flow that shares its work out; return its id, what it has begun meanwhile, and the same afterwards."""
    from prefect import flow
    from prefect.runtime import flow_run

    from flows.shares import shared_out

    seen: list[Any] = []

    @flow
    def study() -> None:
        seen.append(str(flow_run.id))
        for _ in range(times):
            with shared_out(store):
                seen.append(run(shares(seen[0])))

    study()
    return seen[0], seen[-1], run(shares(seen[0]))


def test_each_other_machine_that_takes_runs_gets_one(pool: Store, shared: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT__RUNTIME__DEPLOYMENT__ID", "of the study")
    study, meanwhile, afterwards = begun_and_left(Store(pool.root))
    assert sorted(meanwhile) == [("Scheduled", machine, {"study": study}) for machine in ("box one", "box two")]
    assert sorted(afterwards) == [("Cancelled", machine, {"study": study}) for machine in ("box one", "box two")]


def test_a_study_that_is_taken_over_begins_none_again(
    pool: Store, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PREFECT__RUNTIME__DEPLOYMENT__ID", "of the study")
    assert len(begun_and_left(Store(pool.root), times=2)[2]) == 2


def test_a_machine_alone_shares_nothing_out(pool: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT__RUNTIME__DEPLOYMENT__ID", "of the study")
    assert begun_and_left(pool)[2] == []


def helped(store: Store, monkeypatch: pytest.MonkeyPatch, stage: Stage, ask_every_s: float = 0.2) -> list[Any]:
    """Let a step of a run take three seconds; return what it has begun at its end, and the same afterwards."""
    from prefect import flow
    from prefect.runtime import flow_run

    from flows import shares as flows_shares

    monkeypatch.setattr(flows_shares, "ASK_EVERY_S", ask_every_s)
    seen: list[Any] = []

    def make(visit: Visit) -> None:
        time.sleep(3)
        seen.append(run(shares(str(flow_run.id))))

    @flow
    def scene() -> None:
        work = Work(stage, stage.config(), {}, "recipe", "key")
        flows_shares.with_help(store, make)(Visit(Step(stage), work))
        seen.append(run(shares(str(flow_run.id))))

    scene()
    return seen


async def at_work_on(worker: str, name: str) -> None:
    """Let a worker execute a run of ours."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter
    from prefect.states import Cancelled, Running

    from flows.deployments import of_scene
    from flows.pool import WORKER
    from flows.takeover import unfinished

    async with get_client() as client:
        for left in await client.read_flow_runs(flow_run_filter=FlowRunFilter(state=unfinished())):
            await client.set_flow_run_state(left.id, Cancelled(), force=True)
        deployed = await (await of_scene(name, SceneEntry(photos=None))).aapply()
        busy = await client.create_flow_run_from_deployment(deployed, state=Running(), name=name)
        await client.update_flow_run_labels(busy.id, {WORKER: worker})


def test_a_step_that_takes_long_is_helped_with_by_who_is_idle(
    pool: Store, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(at_work_on("box one (cpu, gpu)", "busy"))
    during, afterwards = helped(Store(pool.root), monkeypatch, DEPTH)
    assert [(state, machine) for state, machine, _ in during] == [("Scheduled", "box two")], (
        "once, however often it asks"
    )
    assert [state for state, _, _ in afterwards] == ["Cancelled"]


def test_a_step_that_cannot_be_shared_or_is_quick_asks_nobody(
    pool: Store, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(at_work_on("box one (cpu, gpu)", "busy"))
    assert helped(Store(pool.root), monkeypatch, GROUPING) == [[], []]
    assert helped(Store(pool.root), monkeypatch, DEPTH, ask_every_s=60.0) == [[], []]


def test_who_helps_makes_what_the_run_is_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Running

    from flows.help_run import help_with
    from flows.regenerate import regenerate

    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    entry = SceneEntry(photos=None)
    write_scene(Store(tmp_path), "town", entry)
    asked: list[str] = []

    def assist(store: Store, work: Work, progress: Progress) -> bool:
        asked.append(work.key)
        return True

    settings = entry.config().model_copy(update={"town": TownConfig(seed=7)})

    async def begun() -> Any:
        async with get_client() as client:
            given = {"scene": "town", "settings": settings.model_dump(mode="json")}
            return (await client.create_flow_run(regenerate, parameters=given, state=Running())).id

    monkeypatch.setattr("flows.help_run.assist", assist)
    town = next(planned(Store(tmp_path), entry.material(), settings))
    assert town.work
    ended = help_with(run(begun()), "town", town.work.key, return_state=True)
    assert ended.is_completed() and ended.message == "town of town"
    assert asked == [town.work.key], "with the settings of the run"
    for step, key in (("town", "another"), ("sfm", town.work.key), ("magic", "another")):
        with pytest.raises(UsageError, match=f"{step} of town would be another one here"):
            help_with(run(begun()), step, key)
    assert len(asked) == 1


@pytest.mark.parametrize("what", ["share", "help"])
def test_a_run_that_is_not_there_is_told(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from flows.help_run import help_with
    from flows.study_run import share

    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    nobody = UUID("00000000-0000-4000-8000-000000000000")
    with pytest.raises(UsageError, match=f"no run {nobody} to take part in"):
        share(nobody) if what == "share" else help_with(nobody, "depth", "key")


def test_a_share_makes_the_cells_of_its_study_and_publishes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from prefect.client.orchestration import get_client
    from prefect.states import Running

    from flows.study_run import share, stability

    made: list[str] = []

    def make_cell(store: Store, cell: Cell[Dosed], make: Make) -> StabilityResult:
        made.append(cell.name)
        return StabilityResult(cell, Trial({}), cell.arm.perturbation.judge.mark, "ok")

    async def begun() -> Any:
        async with get_client() as client:
            given = {"only": ["terraces"], "seeds": 2}
            return (await client.create_flow_run(stability, parameters=given, state=Running())).id

    monkeypatch.setattr("aug3d_core.studies.stability.cell.make_cell", make_cell)
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    ended = share(run(begun()), return_state=True)
    assert ended.is_completed() and ended.message == f"all {len(made)} cells are there"
    assert made and all("terraces" in name for name in made) and {name[-1] for name in made} == {"0", "1"}
    assert not (tmp_path / "studies").exists()
