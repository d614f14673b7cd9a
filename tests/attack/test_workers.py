"""A worker's machine goes dark in mid-run: another takes the run over within two minutes, and goes on with the work."""

from __future__ import annotations

import os
import time
from pathlib import Path

import psutil
import pytest

from tests.attack.town_process import leftovers, stage_of
from tests.journeys.team import Team, team

pytestmark = [pytest.mark.slow, pytest.mark.attack, pytest.mark.long, pytest.mark.timeout(4 * 3600)]
WITHIN_S = 120.0
TOWNS = 6


@pytest.mark.parametrize("stage", ["matching", "depth", "training"])
def test_another_worker_takes_over_what_a_killed_one_did(stage: str, own_environment: None, tmp_path: Path) -> None:
    with team(tmp_path, {"town": {}}, ("one", "two")) as workers:
        batch = workers.start_all()
        workers.wait(lambda: bool(at_work(workers, stage)), 900, f"{stage} is being made")
        [victim] = at_work(workers, stage)
        if stage == "depth":
            shards = tmp_path / victim / "work" / "depth"
            workers.wait(lambda: len([*shards.glob("*/files/raw/*.planes")]) >= 4, 300, "some depth maps are made")
            time.sleep(11)  # they are shared every 10 s
        workers.kill(victim)
        killed, other = time.monotonic(), "two" if victim == "one" else "one"
        workers.wait(lambda: other in name_of_worker(workers), 300, f"{other} takes over")
        workers.wait(lambda: bool(at_work(workers, stage)), 300, f"{other} makes {stage}")
        seconds = time.monotonic() - killed
        print(f"\n{stage}: at work again after {seconds:.0f} s")
        assert seconds < WITHIN_S
        assert leftovers(tmp_path / victim) == []
        workers.end_of(batch, 1800)
        run = workers.scenes()["town"]
        assert (run["state"]["name"], run["run_count"]) == ("Published", 2), run["state"]["message"]
        assert set(workers.made().values()) == {1}


def test_two_workers_are_faster_than_one(own_environment: None, tmp_path: Path) -> None:
    """Each has one core, so that two are what two machines are; the servers take their share of both."""
    cores = sorted(os.sched_getaffinity(0))[:2]
    if len(cores) < 2:
        pytest.skip("two workers with a core each need two cores")
    towns = {f"town{seed}": {"town": {"seed": seed}} for seed in range(TOWNS)}
    seconds = []
    for folder, used in (("alone", cores[:1]), ("both", cores)):
        (tmp_path / folder).mkdir()
        with team(tmp_path / folder, towns, ()) as workers:
            for core in used:
                workers.join(f"core{core}", core)
            started, batch = time.monotonic(), workers.start_all()
            ended = workers.end_of(batch, 3 * 3600)
            seconds.append(time.monotonic() - started)
            assert ended["message"] == f"{TOWNS} scenes are up to date"
            assert set(workers.made().values()) == {1}
    print(f"\n{TOWNS} towns: {seconds[0]:.0f} s with one worker, {seconds[1]:.0f} s with two")
    assert seconds[0] > 1.3 * seconds[1]


def at_work(workers: Team, stage: str) -> list[str]:
    """Return which workers have a process that makes a stage."""
    families = {name: psutil.Process(one.pid).children(recursive=True) for name, one in workers.workers.items()}
    return [name for name, family in families.items() if stage in map(stage_of, family)]


def name_of_worker(workers: Team) -> str:
    return str(workers.scenes()["town"]["labels"].get("prefect.worker.name", ""))
