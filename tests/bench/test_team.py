"""A team of processes: how often a thing was made in it, which stage a process makes, how its store goes away."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from aug3d_core.bench import team
from aug3d_core.bench.s3_service import BUCKET, KEYS, address_of, free_port, s3_process
from aug3d_core.bench.team import Team, leftovers, stage_of, times_made
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store

LOGS = {("one", "depth a"), ("two", "depth b")}


def test_what_a_home_has_a_log_of_was_made_once_whether_or_not_a_version_says_so() -> None:
    computed = {("one", "one/scenes/town/1", "depth a")}
    assert times_made(LOGS, computed) == times_made(LOGS, set()) == {"depth a": 1, "depth b": 1}


def test_who_came_second_is_counted_though_its_log_is_gone() -> None:
    """The store has the first one's: the second finds that at the end, and keeps nothing of its own."""
    assert times_made(LOGS, {("two", "two/scenes/town/1", "depth a")})["depth a"] == 2


def test_two_versions_of_a_home_that_both_made_a_thing_made_it_twice() -> None:
    computed = {("one", f"one/scenes/town/{number}", "depth a") for number in (1, 2)}
    made = times_made(LOGS, computed)
    assert made == {"depth a": 2, "depth b": 1}


def test_a_thing_that_a_killed_worker_and_its_successor_both_made_was_made_twice() -> None:
    """A killed run has no version: of what it made its home has the logs."""
    logs = {("victim", "depth a"), ("other", "depth a")}
    assert times_made(logs, {("other", "other/scenes/town/1", "depth a")})["depth a"] == 2


def test_a_process_is_known_by_the_15_characters_that_the_kernel_keeps() -> None:
    names = {"aug3d depth": "depth", "aug3d evaluatio": "evaluation", "aug3d": "", "python": "", "aug3d up": ""}
    assert {name: stage_of(SimpleNamespace(name=lambda n=name: n)) for name in names} == names  # type: ignore[arg-type]


def test_what_still_runs_for_a_home_is_told_until_it_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waits = [sys.executable, "-c", "import sys; sys.stdin.read()"]
    own = {**os.environ, "PREFECT_HOME": str(tmp_path / "prefect")}
    with subprocess.Popen(waits, stdin=subprocess.PIPE, env=own) as ours:
        with monkeypatch.context() as at_once:
            at_once.setattr(team, "_GONE_S", 0.0)
            assert leftovers(tmp_path / "another") == []
            assert leftovers(tmp_path) == [" ".join(waits)]
        assert ours.stdin
        ours.stdin.close()
        assert leftovers(tmp_path) == []


def test_a_worker_is_known_by_the_name_and_served_by_the_queue_that_the_pool_gives_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from flows.pool import WORKER, PoolWorker

    asked = {}

    def ask(path: str, body: Any = None) -> Any:
        if path == "flow_runs/filter":
            return [{"parameters": {"scene": scene}, "labels": {WORKER: one.name}} for scene, one in made_by.items()]
        asked[path] = body
        return {"id": "a run"} if path.endswith("create_flow_run") else [{"name": "town", "id": "deployed"}]

    pool = {
        name: PoolWorker(Store(tmp_path / name), ("cpu", "gpu"), 1, own=True) for name in ("vm", "vm one", "killed")
    }
    made_by = {f"town of {name}": worker for name, worker in pool.items()}
    members = Team(tmp_path, {}, None, workers={"vm": None, "vm one": None})  # type: ignore[arg-type, dict-item]
    monkeypatch.setattr(members, "ask", ask)
    assert [members.worker_of(scene) for scene in (*made_by, "nobody's")] == ["vm", "vm one", "", ""]
    members.start("town", on="vm one")
    queue = asked["deployments/deployed/create_flow_run"]["work_queue_name"]
    assert [name for name, worker in pool.items() if queue in worker._work_queues] == ["vm one"]


def test_a_store_that_is_away_answers_nothing_and_then_has_what_it_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = free_port()
    for name, value in {**KEYS, "AWS_ENDPOINT_URL": address_of(port)}.items():
        monkeypatch.setenv(name, value)
    bucket = Bucket(f"s3://{BUCKET}/team")
    with s3_process(port) as service, ThreadPoolExecutor(1) as asking:
        bucket.put("a", b"1")
        with Team(tmp_path, {}, service).store_away():
            answer = asking.submit(bucket.get, "a")
            with pytest.raises(NotYet):
                answer.result(1)
        assert answer.result(30) == b"1"
