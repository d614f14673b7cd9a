"""Reports reach whoever listens, the newest of them always, and nothing of the listener reaches the work."""

from __future__ import annotations

import threading
import time
from contextvars import ContextVar

from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.progress import on_the_side


@given(st.lists(st.integers(0, 9), min_size=1, max_size=20))
def test_what_is_told_is_in_order_and_ends_with_the_last(reports: list[int]) -> None:
    told: list[int] = []
    with on_the_side(lambda done, total, what: told.append(done)) as report:
        for index, _ in enumerate(reports):
            report(index, len(reports), "x")
    assert told == sorted(set(told)) and told[-1] == len(reports) - 1


def test_a_slow_listener_is_told_the_newest_and_not_what_it_missed() -> None:
    told, busy, free = [], threading.Event(), threading.Event()

    def listen(done: int, total: int, what: str) -> None:
        told.append(done)
        busy.set()
        free.wait(10)

    with on_the_side(listen) as report:
        report(0, 9, "x")
        assert busy.wait(10)
        for done in range(1, 9):
            report(done, 9, "x")
        free.set()
    assert told == [0, 8]


def test_a_listener_that_never_returns_does_not_keep_the_work_from_ending_and_is_told_no_more() -> None:
    told, free = [], threading.Event()
    started = time.monotonic()
    with on_the_side(lambda done, total, what: (told.append(done), free.wait(60))[0]) as report:
        report(0, 9, "x")
        while not told:
            time.sleep(0.01)
        report(1, 9, "x")
    assert time.monotonic() - started < 30
    free.set()
    time.sleep(0.1)
    assert told == [0]


def test_the_listener_finds_the_context_of_the_work() -> None:
    run, seen = ContextVar("run", default="none"), []
    run.set("this run")
    with on_the_side(lambda *_: seen.append(run.get())) as report:
        report(1, 1, "x")
    assert seen == ["this run"]


def test_a_listener_that_fails_is_logged_and_told_again(caplog) -> None:
    calls: list[int] = []

    def fail(done: int, total: int, what: str) -> None:
        calls.append(done)
        raise OSError(f"no {done}")

    with on_the_side(fail) as report:
        for done in (1, 2):
            report(done, 2, "x")
            while len(calls) < done:
                time.sleep(0.01)
    assert calls == [1, 2] and "no 1" in caplog.text and "no 2" in caplog.text
