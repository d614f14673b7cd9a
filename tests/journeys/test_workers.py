"""Two machines that have nothing in common but a store and a Prefect server make a batch of scenes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.journeys.team import team
from tests.store.s3_service import KEYS

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
SCENES = {f"town{number}": {"training": {"steps": 10 + number}} for number in range(3)}  # one town, three models


def test_a_batch_is_spread_and_each_object_is_made_once(own_environment: None, tmp_path: Path) -> None:
    with team(tmp_path, SCENES, ("one", "two")) as workers:
        batch = workers.start_all()

        def both_are_at_work() -> bool:
            running = [run for run in workers.scenes().values() if run["state"]["name"] == "Running"]
            return len({run["labels"]["prefect.worker.name"] for run in running}) == 2

        workers.wait(both_are_at_work, 240, "both are at work")
        told = workers.status()
        scenes = [run for run in told["at_work"] if run["run"] in SCENES]
        assert len({run["machine"] for run in scenes}) == 2 and set(scenes[0]) >= {"steps", "percent", "left_s"}
        assert sum(machine["online"] for machine in told["machines"]) == 4, "two of them and two of aug3d up"
        waiting = {run["run"]: run["why"] for run in told["waiting"]}
        assert set(waiting.values()) <= {"a machine is about to take it", "2 of 2 machines that take it are at work"}
        ended = workers.end_of(batch, 600)
        assert (ended["type"], ended["message"]) == ("COMPLETED", "3 scenes are up to date")
        runs = workers.scenes()
        assert {scene: run["state"]["name"] for scene, run in runs.items()} == dict.fromkeys(SCENES, "Published")
        who = {run["labels"]["prefect.worker.name"] for run in runs.values()}
        assert {name.split()[1] for name in who} == {"one", "two"}, "both have work, and the page says who does what"
        made = workers.made()
        assert set(made.values()) == {1}
        assert sum(name.startswith("town ") for name in made) == 1 and sum("training" in name for name in made) == 3
        said = "".join(workers.log(name) for name in ("up", "one", "two"))
        assert workers.token not in said.replace(f"token={workers.token}", "")
        assert KEYS["AWS_SECRET_ACCESS_KEY"] not in said
