"""Work beside a block ends with it, whatever becomes of the block."""

from __future__ import annotations

from contextvars import ContextVar
from threading import Event

import pytest

from aug3d_core.run.beside import beside

_said = ContextVar("said", default="")


def test_it_works_while_the_block_runs_and_is_waited_for() -> None:
    begun, told = Event(), list[str]()

    def work(over: Event) -> None:
        begun.set()
        assert over.wait(30)
        told.append(_said.get())

    _said.set("in the block's context")
    with beside(work):
        assert begun.wait(30) and not told
    assert told == ["in the block's context"]


def test_a_block_that_fails_ends_it_too() -> None:
    ended = Event()
    with pytest.raises(ZeroDivisionError), beside(lambda over: ended.set() if over.wait(30) else None):
        _ = 1 / 0
    assert ended.is_set()
