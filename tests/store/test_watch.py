"""Watching leases of others: who is dead, by the watcher's own clock, and what falls free with them."""

from __future__ import annotations

import threading
import time

import pytest

from aug3d_core.store import lease as lease_module
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.lease import OWNER, Watch, lease


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in {"RENEW_S": 0.2, "LAPSED_S": 3.0, "LOOK_S": 0.1, "_SEEN_S": 1.0}.items():
        monkeypatch.setattr(lease_module, name, seconds)


def held(place: Bucket, name: str) -> str:
    """Leave a lease as a dead owner does, and return its path."""
    path = f"leases/{name}/00000000"
    place.create(path, b'{"host": "gone", "owner": "gone", "number": 7}')
    return path


def looked(watch: Watch, names: list[str], seconds: float) -> list[str]:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        dead = watch.dead(names)
        time.sleep(0.2)
    return dead


def test_one_that_is_renewed_lives_and_one_that_stands_still_is_dead(bucket: str) -> None:
    place = Bucket(bucket)
    held(place, "runs/still")
    with lease(place, "runs/lives", lambda: False, lambda host: None):
        watch = Watch(place)
        assert looked(watch, ["runs/lives", "runs/still", "runs/never"], 1.5) == []
        assert looked(watch, ["runs/lives", "runs/still", "runs/never"], 2.5) == ["runs/still", "runs/never"]


def test_who_could_not_look_does_not_say_that_others_are_dead(bucket: str) -> None:
    place = Bucket(bucket)
    held(place, "runs/still")
    watch = Watch(place)
    assert watch.dead(["runs/still"]) == []
    time.sleep(4.0)  # the store was away, or this process stood still
    assert watch.dead(["runs/still"]) == []


def test_of_many_watchers_one_takes_over(bucket: str) -> None:
    place, ours = Bucket(bucket), []
    held(place, "runs/still")
    watches = [Watch(place) for _ in range(4)]
    for _ in range(20):
        dead = [watch.dead(["runs/still"]) for watch in watches]
        time.sleep(0.2)
    assert dead == [["runs/still"]] * 4
    everybody = threading.Barrier(4)

    def take(watch: Watch) -> None:
        everybody.wait()
        with watch.taking_over("runs/still") as mine:
            ours.append(mine)

    threads = [threading.Thread(target=take, args=(watch,)) for watch in watches]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(ours) == [False, False, False, True]
    assert [watch.dead(["runs/still"]) for watch in watches] == [[]] * 4, "it has its time again to be taken up"


def test_all_that_the_dead_held_is_free_at_once_and_nothing_else(bucket: str) -> None:
    place = Bucket(bucket)
    held(place, "runs/still")
    held(place, "depth/k")
    watch = Watch(place)
    assert looked(watch, ["runs/still"], 4.0) == ["runs/still"]
    with lease(place, "depth/other", lambda: False, lambda host: None):
        with watch.taking_over("runs/still") as ours:
            assert ours
        since = time.monotonic()
        for name in ("runs/still", "depth/k"):
            with lease(place, name, lambda: False, lambda host: None) as mine:
                assert mine
        assert time.monotonic() - since < 2.0, "nobody waits for the dead"
        waited: list[str] = []
        with lease(place, "depth/other", lambda: len(waited) > 3, waited.append) as mine:
            assert not mine
    assert place.names("leases/") == []


def test_a_worker_and_its_runs_have_one_owner_and_others_another(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    place = Bucket(bucket)
    monkeypatch.setenv(OWNER, "worker")
    with lease(place, "a", lambda: False, lambda host: None), lease(place, "b", lambda: False, lambda host: None):
        owned = [(place.get(name) or b"").count(b'"owner": "worker"') for name in place.names("leases/")]
    assert owned == [1, 1]


def test_an_owner_that_was_taken_over_hears_of_it(bucket: str) -> None:
    place, lost = Bucket(bucket), threading.Event()
    with lease(place, "runs/mine", lambda: False, lambda host: None, lost.set):
        assert not lost.wait(1.0)
        place.create("leases/runs/mine/00000001", b'{"host": "other"}')
        assert lost.wait(5.0)
    assert place.names("leases/") == ["leases/runs/mine/00000001"], "and leaves the other's lease alone"
