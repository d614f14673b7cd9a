"""A study of a shared store begins a run for each other machine, which makes cells too, and ends these runs with itself."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.factory.walk import Make
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.stability.cell import Dosed, StabilityResult
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
        from flows.pool import make_queue

        async with get_client() as client:
            mine = f"{socket.gethostname()} {tmp_path.name}"
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

    monkeypatch.setattr("flows.study_run.make_cell", make_cell)
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    ended = share(run(begun()), return_state=True)
    assert ended.is_completed() and ended.message == f"all {len(made)} cells are there"
    assert made and all("terraces" in name for name in made) and {name[-1] for name in made} == {"0", "1"}
    assert not (tmp_path / "studies").exists()
