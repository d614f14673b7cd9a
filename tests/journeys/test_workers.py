"""Machines that have nothing in common but a store and a Prefect server make a batch of scenes; one of them dies of it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aug3d_core.bench.s3_service import KEYS
from aug3d_core.bench.team import Team, leftovers, team
from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.report.reads import read_of
from aug3d_core.run.files import FILES
from aug3d_core.store.record import read_record
from tests.attack.town_process import digests
from tests.journeys.test_demo import computed, run

pytestmark = [pytest.mark.slow, pytest.mark.timeout(2400)]
SCENES = {f"town{number}": {"training": {"steps": 10 + number}} for number in range(3)}  # one town, three models


def test_a_batch_is_spread_a_machine_dies_and_each_object_is_made_once(
    own_environment: None, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    with team(tmp_path, SCENES, ("one", "two")) as workers:
        batch = workers.start_all()
        workers.wait(lambda: len(whose(workers)) == 2, 600, "both are at work", every_s=1.0)
        told = workers.status()
        scenes = [run for run in told["at_work"] if run["run"] in SCENES]
        assert len({run["machine"] for run in scenes}) == 2 and set(scenes[0]) >= {"steps", "percent", "left_s"}
        assert sum(machine["online"] for machine in told["machines"]) == 4, "two of them and two of aug3d up"
        waiting = {run["run"]: run["why"] for run in told["waiting"]}
        assert set(waiting.values()) <= {"a machine is about to take it", "2 of 2 machines that take it are at work"}

        shards = "work/depth/*/files/raw/*.planes"
        workers.wait(
            lambda: any(len([*tmp_path.glob(f"{name}/{shards}")]) >= 4 for name in ("one", "two")), 600, "depth"
        )
        [victim] = workers.at_work("depth")
        workers.kill(victim)
        [other] = workers.workers
        assert leftovers(tmp_path / victim) == []
        ended = workers.end_of(batch, 1200)
        assert (ended["type"], ended["message"]) == ("COMPLETED", "3 scenes are up to date")
        runs = workers.scenes()
        assert {scene: run["state"]["name"] for scene, run in runs.items()} == dict.fromkeys(SCENES, "Published")
        assert max(run["run_count"] for run in runs.values()) == 2, "what the dead one did was taken over"
        assert whose(workers, "Published") >= {other}, "the page says who did what"
        made = workers.made()
        assert set(made.values()) == {1}
        assert sum(name.startswith("town ") for name in made) == 1 and sum("training" in name for name in made) == 3

        third = tmp_path / "three"
        again = run(third, "--set", "training.steps=10", env={**os.environ, **workers.store})
        assert computed(again) == set(), "a third machine has nothing to do"
        assert again["shared_store"]["mib_down"] > 0, "what the report reads, and the model for its own MLflow"
        for file in third.glob("objects/*/*/record.json"):
            record, files = read_record(file), file.parent / FILES
            here = {path.relative_to(files).as_posix() for path in files.rglob("*") if path.is_file()}
            assert here <= {*read_of(record), MODEL_WEIGHTS, MODEL_CONFIG}, record.stage
        files = [path for path in tmp_path.rglob("*") if path.is_file()]
        assert not [path for path in files if KEYS["AWS_SECRET_ACCESS_KEY"].encode() in path.read_bytes()]
        said = "".join(workers.log(name) for name in ("up", "one", "two"))
        assert workers.token not in said.replace(f"token={workers.token}", "")
    first = request.getfixturevalue("first")  # asked for last: another process makes it meanwhile
    before = [stage.name for stage in FROM_TOWN if stage.name not in ("training", "evaluation")]
    assert {stage: digests(again)[stage] for stage in before} == {stage: digests(first)[stage] for stage in before}


def whose(workers: Team, state: str = "Running") -> set[str]:
    """Return the workers of the runs in a state."""
    there = [run for run in workers.scenes().values() if run["state"]["name"] == state]
    return {run["labels"]["prefect.worker.name"].split()[1] for run in there if "prefect.worker.name" in run["labels"]}
