"""The newest wins: what was asked while one was done, and is no longer wanted, is never begun."""

from __future__ import annotations

import threading

from aug3d_core.view.latest import Latest


def test_what_is_no_longer_wanted_is_left_out() -> None:
    done: list[tuple[int, bool]] = []
    begun, go_on, still = threading.Event(), threading.Event(), threading.Event()

    def do(what: int, stands: bool) -> None:
        begun.set()
        assert go_on.wait(10)
        done.append((what, stands))
        if stands:
            still.set()

    latest = Latest(do, still_s=0.05)
    latest.ask(0)
    assert begun.wait(10)
    for what in range(1, 100):
        latest.ask(what)
    go_on.set()
    assert still.wait(10)
    latest.end()
    assert done == [(0, False), (99, False), (99, True)]


def test_each_that_stands_is_done_once_more() -> None:
    done, still = [], threading.Semaphore(0)

    def do(what: str, stands: bool) -> None:
        done.append((what, stands))
        if stands:
            still.release()

    latest = Latest(do, still_s=0.01)
    for what in ("a", "b"):
        latest.ask(what)
        assert still.acquire(timeout=10)
    latest.end()
    assert done == [("a", False), ("a", True), ("b", False), ("b", True)]


def test_nothing_is_begun_after_the_end() -> None:
    done: list[object] = []
    latest: Latest[str] = Latest(lambda what, _: done.append(what))
    latest.end()
    latest.ask("late")
    assert not done
